"""Plans: the transfer protocol, and what mission items mean."""
