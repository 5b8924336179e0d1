"""The cable's models: a spring and damper, one that hardens, a chain of masses; and the winch's drum."""
