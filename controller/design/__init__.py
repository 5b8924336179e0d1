"""Gain design: from a vehicle description and a rate to the record of gains that the law reads.

Runs before a flight, or in a process of its own during one. May be slow; uses scipy.
"""
