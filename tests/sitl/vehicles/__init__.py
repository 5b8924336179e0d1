"""Tests of `sitl vehicle`."""
