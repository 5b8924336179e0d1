"""What a person runs: the `sitl` command, scenarios, reports."""
