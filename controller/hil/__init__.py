"""The autopilot's side of the HIL link: it answers the plant as PX4 would."""
