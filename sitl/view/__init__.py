"""The live view: a flight in three dimensions in the browser, served from this machine by viser.

In: MAVLink from any vehicle (`listener`), or a finished flight (`replay`). Out: a `View` of each moment,
drawn by `scene`, with numbers by `panel`. A process of its own that only listens.
"""
