"""The autopilot between its links: who arms, which law flies, where it goes.

`autopilot` follows a path from the scenario. `guided` does what ground control asks.
"""
