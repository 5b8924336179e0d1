"""From a study to its flights: every combination, or samples of the space that the varied keys span."""

from __future__ import annotations

import hashlib
import itertools
import json
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.studies.sweep.study import Study, Value, Vary


class Draw(NamedTuple):
    """One flight of a study: all that its worker needs, as plain values."""

    number: int
    inputs: dict[str, Any]
    """By key: what varies, and seed, design, feedback."""
    identity: str
    """Digest of all that decides what happens in it: the same one needs no second flight."""


def draws(study: Study) -> list[Draw]:
    """All flights of a study, in order; the same study gives the same ones."""
    feedbacks: tuple[str | None, ...] = study.feedbacks or (None,)
    combined = itertools.product(_points(study), range(study.seeds), study.designs, feedbacks)
    out = []
    for number, (point, seed, design, feedback) in enumerate(combined):
        inputs = {"seed": seed, "design": design, **point}
        if feedback is not None:
            inputs["feedback"] = feedback
        out.append(Draw(number, inputs, _identity(study, inputs)))
    return out


def _identity(study: Study, inputs: dict[str, Any]) -> str:
    fixed = {
        "scenario": study.scenario,
        "set": study.set,
        "duration": study.duration,
        **({"of_own": changes} if (changes := _changes(study)) else {}),
        "random_vehicles": None if study.random_vehicles is None else study.random_vehicles.model_dump(),
    }
    text = json.dumps([fixed, inputs], sort_keys=True, default=list)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def _changes(study: Study) -> dict[str, str]:
    return {vary.key: vary.of_own for vary in study.vary if vary.of_own is not None}


def _points(study: Study) -> list[dict[str, Any]]:
    """The drawn values by key, without what every point is flown with."""
    if study.sampling == "grid":
        axes = [[(vary.key, value) for value in _steps(vary)] for vary in study.vary]
        points = [dict(point) for point in itertools.product(*axes)]
    else:
        unit = _unit_samples(study)
        points = [
            {vary.key: _at(vary, float(u)) for vary, u in zip(study.vary, row, strict=True)} for row in unit
        ]
    if study.random_vehicles is not None:
        if study.sampling == "grid" and not study.vary:
            points = [{} for _ in range(study.samples)]
        for index, point in enumerate(points):
            point["random_vehicle"] = study.seed * 1_000_003 + index
    return points


def _unit_samples(study: Study) -> NDArray[np.float64]:
    """(samples, keys), each in 0..1."""
    from scipy.stats import qmc

    size = len(study.vary)
    if size == 0:
        return np.zeros((study.samples, 0))
    if study.sampling == "random":
        return np.random.default_rng(study.seed).random((study.samples, size))
    if study.sampling == "sobol":
        power = max(0, (study.samples - 1).bit_length())
        engine = qmc.Sobol(size, scramble=True, rng=study.seed)
        return np.asarray(engine.random_base2(power)[: study.samples])
    return np.asarray(qmc.LatinHypercube(size, rng=study.seed).random(study.samples))


def _steps(vary: Vary) -> list[Value]:
    """The values of a key in a grid."""
    if vary.values is not None:
        return list(vary.values)
    shares = (
        np.linspace(0.0, 1.0, vary.steps) if vary.mean is None else (np.arange(vary.steps) + 0.5) / vary.steps
    )
    return [_at(vary, float(share)) for share in shares]


def _at(vary: Vary, share: float) -> Value:
    """The value of a key at a share 0..1 of its distribution."""
    if vary.values is not None:
        return vary.values[min(int(share * len(vary.values)), len(vary.values) - 1)]
    if vary.low is not None and vary.high is not None:
        if vary.scale == "log":
            return float(vary.low * (vary.high / vary.low) ** share)
        return vary.low + share * (vary.high - vary.low)
    from scipy.stats import norm

    assert vary.mean is not None
    assert vary.std is not None
    return float(norm.ppf(min(max(share, 1e-9), 1.0 - 1e-9), vary.mean, vary.std))
