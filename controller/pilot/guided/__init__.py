"""The autopilot under ground control: what the station decides becomes rotor commands.

In: estimates, what the plant says, the station's targets. Out: rotor commands, and the vehicle as stations
are shown it. `stages` lists a tick's parts, each with its due rule. `autopilot` runs them, `laws` chooses the
law and its gains. `session` puts it together with sockets and the background designer.
"""
