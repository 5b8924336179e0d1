"""A study as a file: scenario, what varies, which figures count, and the verdicts on them."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import model_validator

from sitl_bridge.vehicle.files import DescriptionError, beside, validated
from sitl_bridge.vehicle.schema import Section, quantity
from sitl_bridge.vehicle.toml_files import toml_content, toml_text, what_is_wrong

Value = str | float | int | bool | tuple[float, ...]


class Vary(Section):
    """One thing that varies: a list of values, or a range, or a distribution."""

    key: str = quantity(
        "-",
        "of the vehicle, as for --set (cable.rest_length); `plant.KEY`: the controller is not told; "
        "`reference.KEY`: of the scenario's reference, an index for a coordinate (reference.position.0); "
        "or one of vehicle, design, feedback, seed, duration, rate_hz",
        min_length=1,
    )
    values: tuple[Value, ...] | None = quantity("-", "each of these", None, min_length=1)
    low: float | None = quantity("-", "of a range or distribution", None)
    high: float | None = quantity("-", "of a range or distribution", None)
    steps: int = quantity("-", "values of a range in a grid", 5, ge=1, le=10_000)
    scale: Literal["linear", "log"] = quantity("-", "how a range is divided", "linear")
    of_own: Literal["times", "plus"] | None = quantity(
        "-",
        "the drawn number times, or plus, the vehicle's own value; a list's `*` stands for each entry "
        "(plant.rotors.*.time_constant)",
        None,
    )
    mean: float | None = quantity("-", "of a normal distribution", None)
    std: float | None = quantity("-", "of a normal distribution", None, gt=0)

    @model_validator(mode="after")
    def _is_one_of_them(self) -> Vary:
        ranged = self.low is not None or self.high is not None
        normal = self.mean is not None or self.std is not None
        if (self.values is not None) + ranged + normal != 1:
            raise ValueError(f"{self.key}: expected values, or low and high, or mean and std")
        if ranged and (self.low is None or self.high is None or not self.low < self.high):
            raise ValueError(
                f"{self.key}: low = {self.low}, high = {self.high}; expected both, low below high"
            )
        if normal and (self.mean is None or self.std is None):
            raise ValueError(f"{self.key}: mean = {self.mean}, std = {self.std}; expected both")
        if self.scale == "log" and (self.low is None or self.low <= 0.0):
            raise ValueError(f"{self.key}: a logarithmic range begins above 0")
        return self


class Verdict(Section):
    """What has to hold over all flights; the study's exit code is 1 when it does not."""

    figure: str | None = quantity("-", "a figure of the rows", None)
    outcome: tuple[str, ...] | None = quantity("-", "count the flights that ended so", None)
    at_most: float | None = quantity("-", "largest value, or number of flights", None)
    at_least: float | None = quantity("-", "smallest value, or number of flights", None)
    share: float = quantity("-", "of the flights for which a figure's limit has to hold", 1.0, ge=0, le=1)

    @model_validator(mode="after")
    def _asks_for_something(self) -> Verdict:
        if (self.figure is None) == (self.outcome is None):
            raise ValueError("verdict: expected either figure or outcome")
        if self.at_most is None and self.at_least is None:
            raise ValueError("verdict: expected at_most or at_least")
        return self


class RandomVehicles(Section):
    """Vehicles drawn at random from the ranges of `studies.random_vehicles`, one for each flight."""

    longest_cable: float = quantity("m", "of the drawn ones", 20.0, gt=0.5, le=100)
    drag: bool = quantity("-", "with drag of vehicle and load, so that wind matters", False)


DEFAULT_FIGURES = (
    "settling_time_2pct_s",
    "settling_time_1cm_s",
    "overshoot_pct",
    "steady_state_error_m",
    "tracking_rms_m",
    "largest_tilt_deg",
    "largest_tension_N",
    "smallest_tension_N",
)


class Study(Section):
    """What `sitl sweep FILE` flies."""

    name: str = quantity("-", "short name", min_length=1)
    description: str = quantity("-", "what it is to find out", "")
    scenario: str = quantity("-", "name or file", "setpoint")
    set: tuple[str, ...] = quantity("-", "overrides of every flight, KEY=VALUE", ())
    duration: float | None = quantity("s", "of each flight; by default the scenario's", None, gt=0)
    sampling: Literal["grid", "latin-hypercube", "sobol", "random"] = quantity(
        "-", "how what varies is combined", "grid"
    )
    samples: int = quantity("-", "draws, for all but a grid", 100, ge=1, le=1_000_000)
    seed: int = quantity("-", "of the draws", 0, ge=0)
    seeds: int = quantity("-", "flights of each draw, with seeds 0, 1, …", 1, ge=1, le=100_000)
    designs: tuple[str, ...] = quantity("-", "each flies the same draws", ("default",), min_length=1)
    feedbacks: tuple[Literal["truth", "estimate"], ...] = quantity(
        "-", "each flies the same draws; none: as usual", ()
    )
    vary: tuple[Vary, ...] = ()
    random_vehicles: RandomVehicles | None = None
    figures: tuple[str, ...] = quantity("-", "kept in the rows", DEFAULT_FIGURES)
    logs: Literal["none", "failures", "all"] = quantity("-", "of which flights the logs are kept", "none")
    verdict: tuple[Verdict, ...] = ()


def load_study(file: Path) -> Study:
    """Read a study; raises DescriptionError with a line for each fault. Paths are relative to its folder."""
    try:
        content = toml_content(toml_text(file))
    except OSError as error:
        raise DescriptionError(str(file), [f"{error.strerror}; expected a study, a .toml file"]) from None
    except ValueError as error:
        raise DescriptionError(str(file), [what_is_wrong(error)]) from None
    study = validated(Study, content, str(file))
    vary = tuple(_vehicles_beside(entry, str(file)) for entry in study.vary)
    return study.model_copy(update={"scenario": beside(study.scenario, str(file)), "vary": vary})


def _vehicles_beside(vary: Vary, file: str) -> Vary:
    """What varies, the paths of vehicles relative to the study's file."""
    if vary.key != "vehicle" or vary.values is None:
        return vary
    values = tuple(beside(value, file) if isinstance(value, str) else value for value in vary.values)
    return vary.model_copy(update={"values": values})
