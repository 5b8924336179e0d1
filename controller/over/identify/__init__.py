"""`sitl identify`: how a flight stack follows its set-points, measured in a minute of gentle flight.

`excitation` adds small sines to what the law wants, `record` keeps what came of them, `fit` finds lag, delay
and thrust curve from that. The result is a `Stack`.
"""
