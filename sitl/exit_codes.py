"""Exit codes of the `sitl` command."""

FAILED = 1
"""The flight did not settle, a figure is out of its tolerance, or a process failed."""
USAGE = 2
"""The command line, a file or a description is wrong."""
INTERRUPTED = 130
"""Ended by Ctrl-C."""
