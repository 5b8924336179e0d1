"""The estimator as an autopilot under ground control sees it: contacts, health, and quality."""

from __future__ import annotations

import math

from controller.estimator.records import LOAD_DROPPED, LOAD_ON_CABLE, LOAD_ON_GROUND, LOAD_RELEASED, SENSORS
from controller.feedback.assessment import Contact
from controller.feedback.estimate import EstimateFeedback
from controller.feedback.health_notices import HealthWatch, sensors_good
from controller.ground.telemetry.vehicle_state import EstimateQuality, VehicleView
from controller.law.state import Array


class EstimateAssessor:
    """Judges the estimate that an autopilot under ground control flies on."""

    feels_hook = True

    def __init__(self, feedback: EstimateFeedback) -> None:
        self._feedback = feedback
        self._watch = HealthWatch(feedback.estimator.vehicle.sensors.tracker is not None)
        self._given_up = False

    def contact(self, estimate: Array) -> Contact:
        """As the filter's models have it: height is not known well enough to go by."""
        estimator = self._feedback.estimator
        aligned, load = estimator.aligned, estimator.load_mode
        has_ground = estimator.tuning.has_ground
        taut = aligned and load == LOAD_ON_CABLE and estimator.tension > 0.0
        return Contact(
            vehicle_on_ground=has_ground and (estimator.grounded or not aligned),
            load_on_ground=has_ground and (load in (LOAD_ON_GROUND, LOAD_DROPPED) or not aligned),
            load_lifted=taut,
            cable_taut=taut,
            load_attached=self.attached(estimate),
            in_flight=aligned and estimator.in_flight,
        )

    def attached(self, estimate: Array) -> bool:
        """As the filter's model of the load has it."""
        return self._feedback.estimator.load_mode not in (LOAD_RELEASED, LOAD_DROPPED)

    def reeled(self, rest_length: float, rate: float) -> None:
        """The filter's cable is as long."""
        self._feedback.estimator.reeled(rest_length, rate)

    def load_released(self) -> None:
        """The filter's cable pulls no more."""
        self._feedback.estimator.load_released()

    def hook(self, closed: bool) -> None:
        """A pull then is that of a load that was dropped."""
        self._feedback.estimator.hook(closed)

    def give_up(self) -> None:
        """No estimate until the filter aligns anew: blows and a place on its back are not in its models."""
        self._given_up = self._given_up or self._feedback.estimator.flying

    def assess(self, view: VehicleView) -> list[str]:
        """Health and quality into the view; what there is to say."""
        if self._given_up and self._feedback.estimator.flying:
            return _without_estimate(view)
        self._given_up, view.estimated = False, True
        health = self._feedback.estimator.health()
        ready = self._feedback.estimator.flying or self._feedback.ready()
        for name, good in sensors_good(health).items():
            setattr(view.health, name, good)
        view.health.wrong = next((name for name in SENSORS if health.sensors[name].offset > 0.0), "")
        view.health.attitude = health.attitude
        view.health.position = health.position and health.velocity and ready
        view.health.load = health.load or health.load_released or not view.cable_taut
        ratios = {name: sensor.test_ratio for name, sensor in health.sensors.items()}
        view.quality = EstimateQuality(
            velocity=health.velocity,
            dead_reckoning=health.dead_reckoning,
            gps_glitch=health.gps_glitch,
            velocity_ratio=ratios["gps_velocity"],
            position_ratio=ratios["gps_position"],
            height_ratio=ratios["barometer"],
            heading_ratio=ratios["magnetometer"],
            horizontal_accuracy=health.position_std if health.aligned else math.nan,
            vertical_accuracy=health.height_std if health.aligned else math.nan,
        )
        return self._watch.changes(health) if health.aligned else []


def _without_estimate(view: VehicleView) -> list[str]:
    """Into the view that there is no estimate any more; what there is to say."""
    view.health.attitude = view.health.position = view.health.load = False
    nothing, ratios = math.nan, (math.nan,) * 4
    view.quality = EstimateQuality(False, False, False, *ratios, nothing, nothing)
    if not view.estimated:
        return []
    view.estimated = False
    return ["Fallen over: no estimate, position is the GPS receiver's"]
