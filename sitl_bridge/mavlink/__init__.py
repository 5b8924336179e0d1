"""Bytes <-> messages, and the links that carry them. No physics."""
