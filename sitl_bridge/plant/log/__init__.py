"""What a run leaves behind: the state log, the account at the end, messages to the terminal."""
