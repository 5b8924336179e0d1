"""UDP ports of ground control's links, PX4's. The command line has them from here, so nothing is imported."""

STATION_LOCAL, STATION_PEER = 18570, 14550
"""Of the link for ground stations: our own (plus the instance), and whom it speaks to first."""
ONBOARD_LOCAL, ONBOARD_PEER = 14580, 14540
"""Of the link for MAVSDK and companion computers, likewise, both plus the instance."""
STATION_LINK, ONBOARD_LINK = 0, 1
"""Numbers of the two links: for ground stations, and for companions"""
