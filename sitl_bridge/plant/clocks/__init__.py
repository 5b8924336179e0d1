"""When a tick happens: in lockstep with the autopilot, or against the wall clock.

Protocol objects without I/O: `receive(datagram, now)`, `to_send(now)`, `next_deadline()`.
"""
