"""`sitl fly --over`: plant and companion for a flight stack that somebody else starts.

In: a scenario and the stack's address. Out: the folder of a flight, as `sitl.flights` leaves it, with times
that count from the take-over. It imports `sitl.flights`, and the controller as an autopilot's user does.
"""
