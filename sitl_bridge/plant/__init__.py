"""The plant: vehicle, elastic cable and load, their sensors, and the simulator's side of the HIL link."""
