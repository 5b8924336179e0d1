"""The chain against MuJoCo: point masses on tendons that pull like springs beyond their length."""

import mujoco
import numpy as np

from sitl_bridge.plant.physics.state import LOAD_POSITION
from sitl_bridge.vehicle.chain import end_mass
from tests.plant.flying import Flight, plain_vehicle

SEGMENTS, STIFFNESS, MASS, LOAD = 6, 400.0, 0.2, 0.7
FIXED = 1e9
"""kg: a vehicle that the chain does not move."""


def model(masses: list[float], spring_length: float) -> str:
    """Bodies (n,) that slide freely, each on a tendon from the one before, the first from the origin."""
    slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    bodies = "".join(
        f'<body>{slides}<inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>'
        f'<site name="s{i + 1}"/></body>'
        for i, mass in enumerate(masses)
    )
    tendons = "".join(
        f'<spatial stiffness="{STIFFNESS * SEGMENTS}" springlength="0 {spring_length}">'
        f'<site site="s{i}"/><site site="s{i + 1}"/></spatial>'
        for i in range(len(masses))
    )
    return (
        '<mujoco><option integrator="RK4" timestep="1e-4" gravity="0 0 -9.81"/>'
        f'<worldbody><site name="s0"/>{bodies}</worldbody><tendon>{tendons}</tendon></mujoco>'
    )


def test_a_chain_that_swings_from_the_side_moves_as_in_mujoco() -> None:
    """Let go from a line at 45 degrees: within 10 micrometres over a second, of a way of 1.4 m."""
    vehicle = plain_vehicle(
        cable={"model": "chain", "segments": SEGMENTS, "stiffness": STIFFNESS, "mass": MASS},
        initial={"load_position": [0.75, 0.0, -0.75], "vehicle_position": [0.0, 0.0, 0.0]},
    )
    plant = Flight(vehicle)
    plant.record["vehicle_mass"] = FIXED
    plant.forces[0, 2] = FIXED * vehicle.gravity
    plant.inner[:4] = 0.0
    own = plant.inner[-6 * 19 :].reshape(-1, 6)[: SEGMENTS - 1]
    masses = [*[MASS / SEGMENTS] * (SEGMENTS - 1), LOAD + end_mass(vehicle)]
    system = mujoco.MjModel.from_xml_string(model(masses, vehicle.cable.rest_length / SEGMENTS))
    data = mujoco.MjData(system)
    data.qpos[:] = np.vstack([own[:, :3], plant.x[LOAD_POSITION]]).ravel()
    start, apart, moved = data.qpos.copy(), 0.0, 0.0
    for _ in range(20):
        for _ in range(500):
            mujoco.mj_step(system, data)
        plant.run(0.05, 1e-4)
        mine = np.vstack([own[:, :3], plant.x[LOAD_POSITION]])
        apart = max(apart, float(np.max(np.abs(mine.ravel() - data.qpos))))
        moved = max(moved, float(np.max(np.abs(data.qpos - start))))
    assert moved > 1.0
    assert apart < 1e-5
