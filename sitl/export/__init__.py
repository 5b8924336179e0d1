"""Flights for other tools: MCAP (Foxglove, PlotJuggler), ULog (pyulog, PlotJuggler), CSV, MATLAB.

In: a `Recording`. Out: files. Frames are those of the format: ENU/FLU in MCAP, NED/FRD in ULog.
CSV and MATLAB have the state log's own columns.
"""
