"""Cascaded PID: load position -> lean of the cable -> attitude -> moments.

Try it: sitl fly setpoint --law examples/laws/cascaded_pid.py:CascadedPid --in-process
"""

import numpy as np


class CascadedPid:
    def __init__(self, *, vehicle, rate_hz):
        self.period = 1.0 / rate_hz
        self.gravity = vehicle.gravity
        self.mass, self.load_mass = vehicle.airframe.mass, vehicle.load.mass
        self.inertia = np.array(vehicle.airframe.inertia)
        self.length = vehicle.hover_length
        # Each loop is some four times as fast as the one around it; the rotors limit the innermost (rad/s).
        lag = max(rotor.time_constant for rotor in vehicle.rotors) + 2.0 * self.period
        self.attitude_frequency = min(16.0, 0.3 / lag)
        self.lean_frequency = min(3.0 * np.sqrt(self.gravity / self.length), self.attitude_frequency / 4.0)
        self.load_frequency = self.lean_frequency / 4.0
        self.integral = np.zeros(3)

    def step(self, estimate, reference):
        # Load: PID from its position to the acceleration that it is to have.
        error = reference.position - estimate.load_position
        drift = reference.velocity - estimate.load_velocity
        w = self.load_frequency
        self.integral += self.period * 0.12 * w**3 * np.clip(error, -0.5, 0.5)
        wanted = reference.acceleration + w**2 * error + 2.0 * w * drift + self.integral

        # Cable: sideways it is a pendulum; the vehicle leads the load by (l/g) times the wanted acceleration.
        stretch = self.length / self.gravity
        lead = estimate.position - estimate.load_position
        lead_rate = estimate.velocity - estimate.load_velocity
        pulled = lead / stretch  # the load's acceleration as it is
        wanted_rate = reference.jerk + w**2 * drift + 2.0 * w * (reference.acceleration - pulled)
        w = self.lean_frequency
        acceleration = w**2 * (stretch * wanted - lead) + 1.6 * w * (stretch * wanted_rate - lead_rate)
        acceleration += pulled + stretch * reference.snap
        # Up and down the vehicle carries the load on a spring: PID on the load, damped by its own velocity.
        w = 0.4 * w
        climb = reference.velocity[2] - estimate.velocity[2]
        height = reference.position[2] + self.length - estimate.position[2]
        acceleration[2] = reference.acceleration[2] + w**2 * height + 1.6 * w * climb + self.integral[2]

        # Force: what accelerates the vehicle, and carries both it and the load on its leaning cable.
        weight = np.array([0.0, 0.0, self.mass * self.gravity])
        force = self.mass * acceleration + weight - self.load_mass * self.gravity * estimate.cable_direction
        # Attitude: PD that turns the thrust axis to the force, and the heading to the reference.
        aim = estimate.rotation.T @ force / np.linalg.norm(force)
        angle = np.array([-aim[1], aim[0], np.sin(reference.yaw - estimate.attitude[2])])
        w = self.attitude_frequency * np.array([1.0, 1.0, 0.3])
        moments = self.inertia * (w**2 * angle - 2.0 * w * estimate.body_rates)
        return force @ estimate.rotation[:, 2], moments
