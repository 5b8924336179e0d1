"""The same law over a flight stack: a companion flies the load while PX4 or ArduPilot flies the vehicle.

In: the stack's telemetry, and what is known of the load. Out: thrust and body rates in offboard mode.
`companion` is the protocol object; `phases` has what it does from the first HEARTBEAT to the landing; `load`
knows where the load is; `law` is the control law; `stack` and `dialects` have what differs from one stack to
another. It imports the controller's law and design, and `sitl_bridge` without the plant.
"""
