"""Simulation to messages and back: the frames of a tick, slow frames, the autopilot's answers."""
