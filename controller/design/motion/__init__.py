"""Motions of a reference: how it leaves its start as fast as vehicle and cable can follow.

In: a path, the vehicle, limits. Out: the path with a profile that is planned for them.
"""
