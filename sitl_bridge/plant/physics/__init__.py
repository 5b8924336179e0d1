"""What happens to vehicle, cable and load: equations of motion, contacts, air, rotors, battery.

In: rotor commands, forces, wind. Out: the next state, and what the bodies feel. Knows no messages.
"""
