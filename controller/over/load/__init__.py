"""Where the load is: sources of the law's state from the stack's telemetry and the load's own messages."""
