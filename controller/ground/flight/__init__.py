"""Flying under ground control: modes, guidance, missions, failsafes; the target of each moment."""
