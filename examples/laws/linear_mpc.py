"""Linear MPC with OSQP (`pip install "sitl-bridge[mpc]"`): plans the force on the vehicle 20 times a second.

Try it: sitl fly setpoint --law examples/laws/linear_mpc.py:LinearMpc --in-process
"""

import numpy as np
import osqp
from scipy import linalg, sparse

from controller.design.model import linear_model

N, PERIOD, LARGEST_TILT = 40, 0.05, 0.4  # steps of the horizon, s, rad


class LinearMpc:
    def __init__(self, *, vehicle, rate_hz):
        self.every = max(1, round(rate_hz * PERIOD))  # ticks between two plans
        self.ticks, self.weight = 0, vehicle.hover_thrust
        self.inertia = np.array(vehicle.airframe.inertia)
        lag = max(rotor.time_constant for rotor in vehicle.rotors) + 2.0 / rate_hz
        self.attitude_frequency = min(16.0, 0.3 / lag)  # rad/s
        # The paper's linear model without attitude: the force on the vehicle moves both bodies.
        self.hover = np.array([0.0, 0.0, vehicle.hover_length, *[0.0] * 9])
        a = linear_model(vehicle).A[:12, :12]
        b = np.vstack([np.zeros((6, 3)), np.eye(3) / vehicle.airframe.mass, np.zeros((3, 3))])
        held = linalg.expm(np.block([[a, b], [np.zeros((3, 15))]]) * self.every / rate_hz)
        self.a, b = held[:12, :12], held[:12, 12:]
        # Cost: the load's deviation, and the force; at the end of the horizon what an LQR would still pay.
        self.q = np.diag([0.01] * 3 + [4.0] * 3 + [0.1] * 3 + [1.0] * 3)
        r = np.eye(3) * 25.0 / self.weight**2
        self.end = linalg.solve_discrete_are(self.a, b, self.q, r)
        cost = sparse.block_diag([*[self.q] * (N - 1), self.end, *[r] * N], "csc")
        # Unknowns x[1..N], u[0..N-1]; constraints x[k+1] - A x[k] - B u[k] = 0, and u within its limits.
        chain = sparse.eye(12 * N) - sparse.kron(sparse.eye(N, k=-1), self.a)
        rows = [[chain, -sparse.kron(sparse.eye(N), b)], [None, sparse.eye(3 * N)]]
        most = sum(rotor.thrust_coefficient * rotor.max_speed**2 for rotor in vehicle.rotors)
        side = LARGEST_TILT * self.weight
        self.low = np.append(np.zeros(12 * N), np.tile([-side, -side, -0.5 * self.weight], N))
        self.high = np.append(np.zeros(12 * N), np.tile([side, side, 0.9 * most - self.weight], N))
        self.solver = osqp.OSQP()
        self.solver.setup(
            cost, np.zeros(15 * N), sparse.bmat(rows, "csc"), self.low, self.high, verbose=False
        )

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
        # The reference goes on at its velocity for half a second; the vehicle is to be above it.
        t = np.minimum(np.arange(1, N + 1) * PERIOD, 0.5)[:, None]
        place, velocity = reference.position + t * reference.velocity, np.tile(reference.velocity, (N, 1))
        wanted = np.hstack([place, place, velocity, velocity])
        linear = np.concatenate([(-wanted[:-1] @ self.q).ravel(), -self.end @ wanted[-1], np.zeros(3 * N)])
        self.low[:12] = self.high[:12] = self.a @ (estimate.state[:12] - self.hover)
        self.solver.update(q=linear, l=self.low, u=self.high)
        return self.solver.solve(raise_error=False).x[12 * N : 12 * N + 3]
