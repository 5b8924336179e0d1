"""How long the tests wait for a vehicle to do or say something."""

PATIENCE = 60.0
"""s, generous: two shared cores, perhaps with a compiler at work; who gets an answer waits no longer."""
LONG_PATIENCE = 180.0
"""s, for a whole take-off, mission or return"""
