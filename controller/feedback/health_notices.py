"""Changes of the estimator's health, in words: each is said once."""

from __future__ import annotations

from controller.estimator.filter import Health, SensorHealth

SILENCE = {"gyroscope": 0.5, "accelerometer": 0.5, "magnetometer": 2.0, "barometer": 2.0, "gps": 2.0}
"""s without a sample that could be used, after which a sensor counts as lost."""
TRACKER_SILENCE = 2.0
_RIGHT = SensorHealth(0.0, 0, 0.0, 1.0, 1.0)


class HealthWatch:
    """Remembers what was said, so that each change is said once."""

    def __init__(self, tracker_fitted: bool) -> None:
        self._tracker_fitted = tracker_fitted
        self._said: set[str] = set()

    def changes(self, health: Health) -> list[str]:
        """What has come up or gone since the last call."""
        found: list[str] = []
        for name, (holds, begins, ends) in self._conditions(health).items():
            if holds != (name in self._said):
                (self._said.add if holds else self._said.discard)(name)
                found.append(begins if holds else ends)
        return found

    def _conditions(self, health: Health) -> dict[str, tuple[bool, str, str]]:
        conditions = {
            name: (not good, f"{_TITLES[name]} lost: {_EFFECTS[name]}", f"{_TITLES[name]} is back")
            for name, good in _used(health).items()
        }
        for name, unit in _INERTIAL.items():
            offset = health.sensors[name].offset
            wrong = f"{_TITLES[name]} wrong by {offset:.2g} {unit}: taken out"
            conditions[f"{name} wrong"] = (offset > 0.0, wrong, f"{_TITLES[name]} is right again")
        conditions["glitch"] = (
            health.gps_refused,
            "GPS refused: it contradicts everything else",
            "GPS is believed again",
        )
        if self._tracker_fitted:
            lost = health.sensors["tracker"].age > TRACKER_SILENCE
            effect = "the accelerometer shows the load"
            conditions["tracker"] = (lost, f"Load tracker lost: {effect}", "Load tracker is back")
        return conditions


_TITLES = {
    "gyroscope": "Gyroscope",
    "accelerometer": "Accelerometer",
    "magnetometer": "Magnetometer",
    "barometer": "Barometer",
    "gps": "GPS",
}
_INERTIAL = {"accelerometer": "m/s^2", "gyroscope": "rad/s"}
_EFFECTS = {
    "gyroscope": "the rates are the model's",
    "accelerometer": "the load is not seen",
    "magnetometer": "the heading drifts",
    "barometer": "GPS alone gives the height",
    "gps": "position and velocity drift",
}


def sensors_good(health: Health) -> dict[str, bool]:
    """Whether each sensor's samples are there, used, and right."""
    return {
        name: used and health.sensors.get(name, _RIGHT).offset == 0.0 for name, used in _used(health).items()
    }


def _used(health: Health) -> dict[str, bool]:
    """Whether each sensor's samples are there and used."""
    ages = {name: health.sensors[name].age for name in SILENCE if name != "gps"}
    ages["gps"] = min(health.sensors["gps_position"].age, health.sensors["gps_velocity"].age)
    return {name: health.aligned and ages[name] <= limit for name, limit in SILENCE.items()}
