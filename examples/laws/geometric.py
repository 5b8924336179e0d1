"""Geometric control on SE(3), the load's pendulum damped by the lean of the cable.

After Lee, Leok, McClamroch (CDC 2010) for the attitude and Sreenath, Lee, Kumar (CDC 2013) for the load.
Try it: sitl fly circle --law examples/laws/geometric.py:Geometric --in-process
"""

import numpy as np


class Geometric:
    def __init__(self, *, vehicle, rate_hz):
        self.period = 1.0 / rate_hz
        self.up, self.gravity = np.array([0.0, 0.0, 1.0]), vehicle.gravity
        self.mass, self.load_mass = vehicle.airframe.mass, vehicle.load.mass
        self.rest_length, self.stiffness = vehicle.cable.rest_length, vehicle.cable.stiffness
        self.inertia = np.diag(vehicle.airframe.inertia)
        # rad/s: load, cable and attitude in cascade, as fast as the rotors allow.
        lag = max(rotor.time_constant for rotor in vehicle.rotors) + 2.0 * self.period
        self.attitude_frequency = min(18.0, 0.35 / lag)
        self.cable_frequency = min(2.8, self.attitude_frequency / 4.0)
        self.load_frequency = self.cable_frequency / 4.0
        self.integral = np.zeros(3)

    def step(self, estimate, reference):
        # Load: the pull A (N) that the cable is to have on it.
        w = self.load_frequency
        e_x = estimate.load_position - reference.position
        e_v = estimate.load_velocity - reference.velocity
        self.integral += self.period * 0.12 * w**3 * np.clip(e_x, -0.5, 0.5)
        acceleration = reference.acceleration - w**2 * e_x - 2.0 * w * e_v - self.integral
        pull = self.load_mass * (acceleration + self.gravity * self.up)
        tension = np.linalg.norm(pull)
        q_d = -pull / tension  # where the cable is to point, on the sphere S²

        # Cable: PD on S² turns q to q_d, at the rate that the load's jerk asks for, and damps the pendulum.
        q = estimate.cable_direction
        relative = estimate.load_velocity - estimate.velocity
        q_rate = (relative - q * (q @ relative)) / estimate.cable_length
        pulled = -self.load_mass * self.gravity * q / max(0.5, -q[2])  # of the cable as it hangs
        e_a = pulled / self.load_mass - self.gravity * self.up - reference.acceleration
        jerk = self.load_mass * (reference.jerk - w**2 * e_v - 2.0 * w * e_a)
        q_d_rate = -(jerk - q_d * (q_d @ jerk)) / tension
        w = self.cable_frequency
        turn = (
            w**2 * np.cross(q, np.cross(q, q_d))
            + 1.6 * w * (q_rate - q_d_rate)
            + self.load_mass / tension * reference.snap
        )
        length = self.rest_length + tension / self.stiffness
        sideways = length * (turn - q * (q @ turn))
        # Along the cable: the vehicle's height above the load's reference, on the spring.
        w = 0.4 * w
        place = reference.position + length * self.up - estimate.position
        along = w**2 * place + 1.6 * w * (reference.velocity - estimate.velocity) + reference.acceleration
        lift = (along[2] - self.integral[2]) * self.up
        carried = pulled + self.mass * (pulled / self.load_mass - self.gravity * self.up) * [1, 1, 0]
        force = carried + self.mass * (sideways * [1, 1, 0] + lift + self.gravity * self.up)

        # Attitude on SO(3): R_d has its third axis along the force, its first towards the heading.
        heading = np.array([np.cos(reference.yaw), np.sin(reference.yaw), 0.0])
        z = force / np.linalg.norm(force)
        y = np.cross(z, heading) / np.linalg.norm(np.cross(z, heading))
        r = estimate.rotation.T @ np.column_stack([np.cross(y, z), y, z])  # R'R_d
        e_r = 0.5 * np.array([r[1, 2] - r[2, 1], r[2, 0] - r[0, 2], r[0, 1] - r[1, 0]])  # (R_d'R - R'R_d)^v
        w, omega = self.attitude_frequency * np.array([1.0, 1.0, 0.3]), estimate.body_rates
        moments = self.inertia @ (-(w**2) * e_r - 2.0 * w * omega) + np.cross(omega, self.inertia @ omega)
        return force @ estimate.rotation[:, 2], moments
