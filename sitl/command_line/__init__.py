"""The `sitl` command: flags, and what each command does with them."""
