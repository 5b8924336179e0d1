"""How long the tests wait for something that has to come; who gets it waits no longer.

Generous: two cores shared with others, perhaps with a compiler at work. Nothing is judged by these times, and
all of them are well below pytest's own `timeout`.
"""

PATIENCE = 180.0
"""s, for an answer, a start or an end; of a process that talks, since it last said something"""
LONG_PATIENCE = 600.0
"""s, for a whole flight, take-off, mission, return or notebook"""
