"""Linear MPC with OSQP (`pip install "sitl-bridge[mpc]"`): plans the force on the vehicle 20 times a second.

What it plans is the way back to the reference's motion, within what that motion leaves of the limits.
Try it: sitl fly setpoint --law examples/laws/linear_mpc.py:LinearMpc --in-process
"""

import numpy as np
import osqp
from scipy import linalg, sparse

from controller.design.model import linear_model

N, PERIOD, TILT = 40, 0.05, 0.6  # steps of the horizon, s, rad at most


class LinearMpc:
    def __init__(self, *, vehicle, rate_hz):
        self.every = max(1, round(rate_hz * PERIOD))  # ticks between two plans
        self.ticks, self.weight, self.length = 0, vehicle.hover_thrust, vehicle.hover_length
        self.mass, self.load_mass, self.gravity = vehicle.airframe.mass, vehicle.load.mass, vehicle.gravity
        self.inertia = np.array(vehicle.airframe.inertia)
        lag = max(rotor.time_constant for rotor in vehicle.rotors) + 2.0 / rate_hz
        self.attitude_frequency = min(16.0, 0.3 / lag)  # rad/s
        # The paper's linear model without attitude: the force, in shares of the weight, moves both bodies.
        a = linear_model(vehicle).A[:12, :12]
        b = np.vstack([np.zeros((6, 3)), np.eye(3) * self.weight / self.mass, np.zeros((3, 3))])
        held = linalg.expm(np.block([[a, b], [np.zeros((3, 15))]]) * self.every / rate_hz)
        self.a, b = held[:12, :12], held[:12, 12:]
        # Cost: the load's deviation, and the force, more so where the attitude follows slowly; at the end of
        # the horizon what an LQR would still pay.
        q = np.diag([0.01] * 3 + [4.0] * 3 + [0.1] * 3 + [1.0] * 3)
        r = np.eye(3) * 25.0 * (16.0 / self.attitude_frequency) ** 4
        end = linalg.solve_discrete_are(self.a, b, q, r)
        cost = sparse.block_diag([*[q] * (N - 1), end, *[r] * N], "csc")
        # Unknowns x[1..N], u[0..N-1]; constraints x[k+1] - A x[k] - B u[k] = 0, and u within its limits.
        chain = sparse.eye(12 * N) - sparse.kron(sparse.eye(N, k=-1), self.a)
        rows = [[chain, -sparse.kron(sparse.eye(N), b)], [None, sparse.eye(3 * N)]]
        most = sum(rotor.thrust_coefficient * rotor.max_speed**2 for rotor in vehicle.rotors)
        self.most = np.array([TILT, TILT, 0.9 * most / self.weight - 1.0])
        self.low, self.high, self.solver = np.zeros(15 * N), np.zeros(15 * N), osqp.OSQP()
        rows = sparse.bmat(rows, "csc")
        self.solver.setup(cost, np.zeros(15 * N), rows, self.low, self.high, verbose=False)

    def step(self, estimate, reference):
        if self.ticks % self.every == 0:
            self.force = self.plan(estimate, reference)
        self.ticks += 1
        # Attitude: PD to the tilt that points the thrust along the planned force.
        c, s = np.cos(estimate.attitude[2]), np.sin(estimate.attitude[2])
        x, y = c * self.force[0] + s * self.force[1], c * self.force[1] - s * self.force[0]
        angles = np.array([np.arctan(-y / self.weight), np.arctan(x / self.weight), reference.yaw])
        w = self.attitude_frequency * np.array([1.0, 1.0, 0.3])
        moments = self.inertia * (w**2 * (angles - estimate.attitude) - 2.0 * w * estimate.body_rates)
        return (self.weight + self.force[2]) / estimate.rotation[2, 2], moments

    def plan(self, estimate, reference):
        # Both bodies on the reference's motion: the vehicle leads by l/g times the load's acceleration.
        lead, up = self.length / self.gravity * np.array([1.0, 1.0, 0.0]), [0.0, 0.0, self.length]
        above, rate = reference.position + up + lead * reference.acceleration, lead * reference.jerk
        motion = [above, reference.position, reference.velocity + rate, reference.velocity]
        force = self.mass * (reference.acceleration + lead * reference.snap)
        share = (force + self.load_mass * reference.acceleration) / self.weight
        self.low[12 * N :] = np.tile(np.minimum([-TILT, -TILT, -0.5] - share, 0.0), N)
        self.high[12 * N :] = np.tile(np.maximum(self.most - share, 0.0), N)
        self.low[:12] = self.high[:12] = self.a @ (estimate.state[:12] - np.concatenate(motion))
        self.solver.update(l=self.low, u=self.high)
        back = self.solver.solve(raise_error=False).x[12 * N : 12 * N + 3]
        return self.weight * (share + back)
