"""Links to one peer: bytes in and out of sockets and serial lines, as datagrams of whole MAVLink frames.

`address` reads what a person types, `open_link` gives the `Link` for it. Nothing here knows what frames mean,
but that a TCP stream is cut behind each HIL_SENSOR.
"""
