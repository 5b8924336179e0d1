"""Vehicle and load from inertial sensors, magnetometer, barometer and GPS: an error-state Kalman filter."""
