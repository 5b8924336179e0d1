"""Commands and set-points: from a message to its one acknowledgement."""
