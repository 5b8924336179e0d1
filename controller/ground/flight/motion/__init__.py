"""Where a body is to go: set-points and their kinds, patterns, sticks, and the trajectory to them."""
