"""`sitl doctor`: what on this machine helps or prevents a flight.

In: nothing. Out: a list of findings, one a line, each with what to do. The checks import only the standard
library and `packaging` at the top, so that they run where a required package is missing.
"""
