"""What the browser shows: the scene with its parts, the panel, and the controls of time."""
