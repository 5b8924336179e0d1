"""Tests of the vehicle description."""
