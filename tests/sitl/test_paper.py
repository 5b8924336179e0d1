"""`sitl paper --quick`: every verdict stands, every number is in tolerance, the page needs nothing else."""

from __future__ import annotations

import json
import re
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sitl.paper import linear, second
from sitl.paper.record import CORRECTED, REPRODUCED, UNSETTLED, UNSUPPORTED, Ledger
from sitl.paper.run import run
from sitl_bridge.description import load_vehicle
from sitl_bridge.process import StopRequest

VERDICTS = {
    "model": CORRECTED,
    "hover.length": CORRECTED,
    "hover.rotor_speed": CORRECTED,
    "hover.printed_point": UNSUPPORTED,
    "figures.2": REPRODUCED,
    "figures.3": REPRODUCED,
    "figures.4": REPRODUCED,
    "figures.moments": REPRODUCED,
    "appendix_f": CORRECTED,
    "controllability": CORRECTED,
    "gains.bounce": UNSUPPORTED,
    "gains.length": CORRECTED,
    "gains.exist": CORRECTED,
    "figures.8": CORRECTED,
    "figures.9": CORRECTED,
    "steady_state": REPRODUCED,
    "figures.10": CORRECTED,
    "reference.jump": UNSUPPORTED,
    "reference.literal": CORRECTED,
    "figures.11": UNSUPPORTED,
    "sampling": UNSUPPORTED,
    "sampling.design": CORRECTED,
    "elasticity.faster": UNSUPPORTED,
    "elasticity.question": CORRECTED,
    "elasticity.rigid": REPRODUCED,
}


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("paper")
    run(out, True, StopRequest())
    return out


@pytest.fixture(scope="module")
def numbers(quick: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((quick / "paper.json").read_text())
    return content


@pytest.mark.timeout(900)
def test_every_verdict_stands(numbers: dict[str, Any]) -> None:
    assert {key: verdict["verdict"] for key, verdict in numbers["verdicts"].items()} == VERDICTS


@pytest.mark.timeout(900)
def test_every_number_is_within_its_tolerance(numbers: dict[str, Any]) -> None:
    assert {key: c for key, c in numbers["checks"].items() if c["verdict"] != "within"} == {}
    assert len(numbers["checks"]) > 100


def test_the_documented_keys_are_there(numbers: dict[str, Any]) -> None:
    assert np.array(numbers["A"]["true"]).shape == np.array(numbers["A"]["printed"]).shape == (18, 18)
    assert np.array(numbers["B"]).shape == (18, 4)
    assert numbers["controllability_rank"] == 18
    assert np.array(numbers["open_loop_poles"]).shape == (18, 2)
    assert np.array(numbers["K_lqr"]).shape == (4, 18)
    for length in ("1", "10"):
        assert np.array(numbers["K_integral"][length]).shape == (4, 21)
        assert np.array(numbers["closed_loop_poles"]["K_integral"][length]).shape == (21, 2)
        for key in ("settling_time_2pct_s", "settling_time_1cm_s", "overshoot_pct", "tracking_rms_m"):
            assert isinstance(numbers["figures"]["10"][length][key], float)
        for key in ("phase_lag_deg", "radius_ratio", "tracking_rms_m"):
            assert isinstance(numbers["figures"]["11"][length][key], float)
    assert {"2", "3", "4", "5", "8", "9", "10", "11", "12", "13", "14", "15", "16"} <= set(numbers["figures"])
    assert [row["stiffness_N_m"] for row in numbers["elasticity"]][0::4] == [20.0, 1e5]


def test_the_printed_gains_are_those_of_the_poles(numbers: dict[str, Any]) -> None:
    a, b, k = np.array(numbers["A"]["true"]), np.array(numbers["B"]), np.array(numbers["K_lqr"])
    poles = np.array(numbers["closed_loop_poles"]["K_lqr"]) @ np.array([1.0, 1j])
    for pole in np.linalg.eigvals(a - b @ k):
        assert np.abs(poles - pole).min() < 1e-4


def test_the_page_needs_nothing_but_itself(quick: Path) -> None:
    text = (quick / "index.html").read_text()
    sources = re.findall(r'(?:src|href)="([^"]{0,40})', text)
    assert sources
    assert all(source.startswith(("data:image/png;base64,", "#s")) for source in sources)
    assert "<script" not in text
    assert "@import" not in text


def test_a_verdict_falls_with_a_check_that_it_rests_on() -> None:
    ledger = Ledger()
    ledger.check("a.b", 1.0, 2.0, 0.5)
    ledger.judge("claim", "", "", "", REPRODUCED, "", ["a"])
    assert ledger.verdicts[0].verdict == UNSETTLED
    assert ledger.outside == ["a.b"]
    with pytest.raises(ValueError, match="nothing has checked"):
        ledger.judge("other", "", "", "", REPRODUCED, "", ["c"])


def test_a_value_that_is_not_finite_is_no_number() -> None:
    ledger = Ledger()
    ledger.check("x", float("nan"), 0.0, 1.0)
    assert ledger.outside == ["x"]
    assert ledger.document()["x"] is None


def test_exact_rank() -> None:
    third = Fraction(1, 3)
    assert linear.rank([[third, 1 - third], [Fraction(1), Fraction(2)]]) == 1
    assert linear.rank([[third, third], [Fraction(1), Fraction(2)]]) == 2


def test_second_simulation_turns_its_state_back_and_forth() -> None:
    x = np.array([1.0, 2, 3, -1, 0.5, 0.2, 0.3, -0.4, 0.5, 0.6, 0.7, -0.8, 0.1, 0.2, 0.3, 0.4, -0.5, 0.6])
    assert second.eq31(second.from_eq31(x)) == pytest.approx(x.tolist(), abs=1e-12)


def test_second_simulation_hovers() -> None:
    vehicle = load_vehicle("paper")
    rate = second.derivative(vehicle, second.initial_state(vehicle), (vehicle.hover_thrust, 0.0, 0.0, 0.0))
    assert np.abs(rate).max() < 1e-12
