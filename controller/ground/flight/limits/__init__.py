"""What a flight must not do: geofence, failsafes, preconditions for arming."""
