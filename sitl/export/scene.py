"""Vehicle, cable and load as Foxglove's scene entities."""

from __future__ import annotations

from typing import Any

from foxglove import messages as m

from sitl.export.shapes import disc_diameter, load_radius
from sitl_bridge.vehicle.description import Vehicle

Point = tuple[float, float, float]
_UPRIGHT = m.Quaternion(x=0, y=0, z=0, w=1)
_ARM = m.Color(r=0.2, g=0.2, b=0.25, a=1.0)
_DISC = m.Color(r=0.2, g=0.5, b=0.9, a=0.5)
_LOAD = m.Color(r=0.9, g=0.5, b=0.1, a=1.0)
_SLACK = m.Color(r=0.6, g=0.6, b=0.6, a=1.0)


def _line(points: list[Point], thickness: float, color: Any) -> Any:
    return m.LinePrimitive(
        type=m.LinePrimitiveLineType.LineStrip,
        thickness=thickness,
        scale_invariant=True,
        points=[m.Point3(x=x, y=y, z=z) for x, y, z in points],
        color=color,
    )


def cable_entity(stamp: Any, points: list[Point], load_share: float) -> Any:
    """The cable as a line in the world, through a chain's nodes.

    It is grey while slack, and from green to red at twice the load's weight.
    load_share: tension over the load's weight.
    """
    red = min(1.0, max(0.0, 0.5 * load_share))
    color = _SLACK if load_share <= 0.0 else m.Color(r=red, g=1.0 - red, b=0.1, a=1.0)
    return m.SceneEntity(timestamp=stamp, frame_id="world", id="cable", lines=[_line(points, 2.0, color)])


def vehicle_entity(stamp: Any, vehicle: Vehicle) -> Any:
    """Arms and discs in the vehicle's frame."""
    discs = []
    for index, rotor in enumerate(vehicle.rotors):
        x, y, z = rotor.position
        diameter = disc_diameter(vehicle, index)
        pose = m.Pose(position=m.Vector3(x=x, y=y, z=z + 0.02), orientation=_UPRIGHT)
        size = m.Vector3(x=diameter, y=diameter, z=0.01)
        discs.append(m.CylinderPrimitive(pose=pose, size=size, bottom_scale=1, top_scale=1, color=_DISC))
    arms = [_line([(0.0, 0.0, 0.0), rotor.position], 3.0, _ARM) for rotor in vehicle.rotors]
    return m.SceneEntity(
        timestamp=stamp, frame_id="vehicle", id="vehicle", frame_locked=True, lines=arms, cylinders=discs
    )


def load_entity(stamp: Any, vehicle: Vehicle) -> Any:
    """A ball in the load's frame."""
    size = 2.0 * load_radius(vehicle)
    pose = m.Pose(position=m.Vector3(x=0, y=0, z=0), orientation=_UPRIGHT)
    ball = m.SpherePrimitive(pose=pose, size=m.Vector3(x=size, y=size, z=size), color=_LOAD)
    return m.SceneEntity(timestamp=stamp, frame_id="load", id="load", frame_locked=True, spheres=[ball])
