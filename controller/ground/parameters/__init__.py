"""Parameters: their table, the protocol, and the file that keeps them."""
