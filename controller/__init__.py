"""The autopilot: control law, its design, and the vehicle that ground stations see."""
