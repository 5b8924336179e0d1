"""Sensors: truth, one draw of noise and what the sensor remembers make a measurement, in SI and ENU/FLU."""
