"""How fast it is: measurements beside something that runs in the same minutes."""
