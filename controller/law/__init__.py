"""The control law: estimate and reference in, rotor commands out, one pure step at a time.

Compiled at every tick. Knows nothing of HIL, ground control or how the estimate came about.
"""
