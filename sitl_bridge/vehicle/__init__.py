"""The vehicle description: one validated TOML that plant and autopilot read alike.

In: a name or file, `KEY=VALUE` overrides. Out: a frozen `Vehicle` in SI units, or `DescriptionError` with a
line for each fault. Imports nothing else of this project but `frames` and `ids`.
"""
