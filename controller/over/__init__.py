"""The same law over a flight stack: a companion flies the load while PX4 or ArduPilot flies the vehicle.

In: the stack's telemetry, and what is known of the load. Out: thrust and body rates in offboard mode.
`session` is the protocol object; `law` the control law; `stack` what differs from one stack to another.
"""
