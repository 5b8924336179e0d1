"""The vehicle that ground control sees: MAVLink services as objects without sockets and clocks.

`station.Station` ties them together; time is an argument, in seconds of one monotonic clock.
"""
