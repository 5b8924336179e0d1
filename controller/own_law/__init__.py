"""A control law of the user's own, in plain Python: `--law MODULE:NAME` and `sitl.fly(law=...)`.

In: a class or its name, then an estimate and a reference path at each tick. Out: rotor commands, what a call
costs, and one clear message when the law fails. May import `law` and `pilot`. The compiled tick is not used
while such a law flies.
"""
