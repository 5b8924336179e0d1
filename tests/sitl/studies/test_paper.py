"""`sitl paper --quick`: every verdict stands, every number is in tolerance, the page needs nothing else."""

from __future__ import annotations

import html
import json
import math
import re
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sitl.studies.paper import independent_simulation as second
from sitl.studies.paper import page, riccati
from sitl.studies.paper.analysis import controllability, linear_model, printed_model, sampled_loop, stiffness
from sitl.studies.paper.analysis.step import vehicle_with
from sitl.studies.paper.record import (
    CORRECTED,
    NOT_JUDGED,
    REPRODUCED,
    UNSETTLED,
    UNSUPPORTED,
    WITHIN,
    Ledger,
)
from sitl.studies.paper.run import run
from sitl.studies.paper.sections import elasticity, motions
from sitl_bridge.process import StopRequest
from sitl_bridge.vehicle.files import load_vehicle

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
    "beyond.nonlinear": UNSUPPORTED,
    "beyond.tracking": UNSUPPORTED,
    "beyond.start": UNSUPPORTED,
    "beyond.cables": CORRECTED,
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


def test_every_verdict_stands(numbers: dict[str, Any]) -> None:
    assert {key: verdict["verdict"] for key, verdict in numbers["verdicts"].items()} == VERDICTS


def test_every_number_is_within_its_tolerance(numbers: dict[str, Any]) -> None:
    judged = {key: c for key, c in numbers["checks"].items() if c["verdict"] != NOT_JUDGED}
    assert {key: c for key, c in judged.items() if c["verdict"] != WITHIN} == {}
    assert len(judged) > 400


def leaves(value: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    """(dotted key, value) of everything in a table of tables; an array of numbers is one value."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from leaves(inner, (*path, name))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for index, inner in enumerate(value):
            yield from leaves(inner, (*path, str(index)))
    else:
        yield ".".join(path), value


def at(numbers: Any, key: str) -> Any:
    for step in key.split("."):
        numbers = numbers[int(step)] if isinstance(numbers, list) else numbers[step]
    return numbers


def test_every_value_has_an_expectation_beside_it_or_says_why_not(numbers: dict[str, Any]) -> None:
    """The plain results are named here: one more is a decision, not an oversight."""
    checks = numbers["checks"]
    found = dict(
        leaves({key: value for key, value in numbers.items() if key not in ("checks", "verdicts", "run")})
    )
    assert found.keys() == checks.keys()
    for key, value in found.items():
        assert checks[key]["value"] == value
        assert checks[key]["source"], key
    plain = {key for key, check in checks.items() if check["verdict"] == NOT_JUDGED}
    swept = r"elasticity\.\d+\.stiffness_N_m|elasticity_over\.(\w+)\.\d+\.\1|elasticity_crossed\.\w+\.values"
    compared = r"beyond\.(steps|circle|cables|loop|noise|start|bounce)\.[\w.-]+"
    assert {key for key in plain if not re.fullmatch(f"{swept}|{compared}", key)} == {
        "controllability.floating_point_rank",
        "elasticity_rigid_controller.stiffness_N_m",
        *(
            f"reference.x_star_jumps.{case}_{length}_{what}_after_s"
            for case in ("setpoint", "circle")
            for length in (1, 10)
            for what in ("tips_over", "lost")
        ),
    }
    assert all(checks[key]["expected"] is None for key in plain)


def test_every_number_in_a_table_is_in_the_file(quick: Path, numbers: dict[str, Any]) -> None:
    text = (quick / "index.html").read_text()
    cells = re.findall(r'<td class="n"([^>]*)>([^<]*)</td>', text)
    assert len(cells) > 300
    for attributes, shown in cells:
        match = re.fullmatch(r' data-key="([^"]+)" data-scale="([^"]+)"', attributes)
        assert match, shown
        value, scale = at(numbers, match[1]), float(match[2])
        assert shown == page.number(value if scale == 1.0 or value is None else scale * value)


def strangers(text: str, checks: dict[str, Any]) -> list[str]:
    """Decimal numbers in the page's sentences that no single value or expectation in the file rounds to."""
    sides = [np.array(check[side]).ravel() for check in checks.values() for side in ("value", "expected")]
    # Matrices have so many entries that one of them would fit anything.
    known = [abs(v) for side in sides if side.size <= 4 for v in side if isinstance(v, (int, float))]
    text = re.sub(r"(?s)<(style|table|code|pre)\b.*?</\1>|<img[^>]*>", "", text)
    text = html.unescape(re.sub(r"<[^>]*>", " ", text))
    out = []
    scales = {" %": 100.0, " mm": 1000.0, " ms": 1000.0, "°": 180.0 / math.pi}
    for shown, unit in re.findall(r"(\d+\.\d+)(?![\d.]*e)( %| mm| ms|°)?", text):
        digits, scale = len(shown.split(".")[1]), scales.get(unit, 1.0)
        if not any(f"{scale * value:.{digits}f}" == shown for value in known):
            out.append(shown)
    return out


def test_the_numbers_in_the_sentences_are_in_the_file(quick: Path, numbers: dict[str, Any]) -> None:
    text, checks = (quick / "index.html").read_text(), numbers["checks"]
    assert strangers(text, checks) == []
    fewer = {key: check for key, check in checks.items() if "damping_needed" not in key}
    assert len(strangers(text, fewer)) == 2  # one that is missing would be seen


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


def test_a_plain_result_bears_no_verdict() -> None:
    ledger = Ledger()
    ledger.put("a.b", 3.0, "m", "nothing to compare it with")
    assert ledger.outside == []
    assert ledger.judged == 0
    assert ledger.checks["a.b"]["verdict"] == NOT_JUDGED
    with pytest.raises(ValueError, match="nothing has checked"):
        ledger.judge("claim", "", "", "", REPRODUCED, "", ["a"])


def test_arrays_and_poles_are_held_to_each_entry() -> None:
    ledger = Ledger()
    ledger.check_array("a", [1.0, 2.0], [1.0, 2.1], 0.05, "", "")
    ledger.check_array("b", [1.0, 2.0], [1.0], 0.05, "", "")
    ledger.check_array("c", [1.0, float("nan")], [1.0, 2.0], 0.05, "", "")
    ledger.check_poles("d", [1j, -1j, -2.0], [-2.0, 1j, -1j], 1e-9, "", "")
    ledger.check_poles("e", [1j, 1j, -2.0], [-2.0, 1j, -1j], 1e-9, "", "")
    assert ledger.outside == ["a", "b", "c", "e"]
    assert ledger.checks["d"]["expected"] == [[0.0, 1.0], [0.0, -1.0], [-2.0, 0.0]]


def test_a_table_shows_what_the_ledger_has_and_nothing_else() -> None:
    ledger = Ledger()
    ledger.rows("sweep", 2)
    ledger.check("sweep.1.delay_s", 0.0015, 0.0015, 1e-9)
    shown = page.table(ledger, ("delay [ms]",), [(page.Cell("sweep.1.delay_s", 1e3),)])
    assert 'data-key="sweep.1.delay_s" data-scale="1000">1.5</td>' in shown
    with pytest.raises(KeyError):
        page.table(ledger, ("",), [(page.Cell("sweep.0.delay_s"),)])
    with pytest.raises(AttributeError):
        page.table(ledger, ("",), [(1.5,)])  # type: ignore[list-item]


def test_f2_is_a_transcription_of_its_own() -> None:
    a, in_text = printed_model.linmod_matrix()
    assert np.count_nonzero(in_text) == 323
    assert not in_text[17, 17]
    assert np.array_equal(a, printed_model.printed_matrices()[0])


def test_what_drives_an_oscillation_is_not_taken_for_its_own() -> None:
    time = np.linspace(0.0, 5.0, 2501)
    natural, ratio = 4.5, 0.22
    drive = np.where(time < 1.0, 3.0, np.sin(2.0 * time))
    states, step = [np.zeros(2)], time[1] - time[0]
    for k in range(len(time) - 1):  # the midpoint rule, with the drive at both ends

        def rate(y: Any, u: float) -> Any:
            return np.array([y[1], u - 2.0 * ratio * natural * y[1] - natural**2 * y[0]])

        half = states[-1] + 0.5 * step * rate(states[-1], drive[k])
        states.append(states[-1] + step * rate(half, 0.5 * (drive[k] + drive[k + 1])))
    frequency, damping = motions.driven_oscillation(time, np.array(states)[:, 0], drive)
    assert frequency == pytest.approx(natural * math.sqrt(1.0 - ratio**2) / (2.0 * math.pi), rel=1e-3)
    assert damping == pytest.approx(ratio, rel=1e-3)
    alone, _ = motions.oscillation(time, np.array(states)[:, 0])
    assert abs(alone - frequency) > 0.05


def test_two_ways_to_a_delay_margin() -> None:
    """A double integrator with u = -(x + 2 x'), whose margin one can work out."""
    model = sampled_loop.LinearModel(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]))
    gain = np.array([[1.0, 2.0]])
    crossover = math.sqrt(2.0 + math.sqrt(5.0))
    margin = math.atan(2.0 * crossover) / crossover
    assert sampled_loop.delay_margins(model, gain) == pytest.approx([margin], rel=1e-6)
    assert sampled_loop.delay_until_unstable(model, gain, 0) == pytest.approx(margin, rel=1e-4)


def test_gains_without_a_riccati_solver_are_optimal() -> None:
    """One state, worked out by hand: x' = x + u with Q = R = 1 has K = 1 + sqrt(2)."""
    model, one = sampled_loop.LinearModel(np.eye(1), np.eye(1)), np.eye(1)
    optimum = riccati.continuous(model, riccati.Weights(one, one))
    assert optimum.gain[0, 0] == pytest.approx(1.0 + math.sqrt(2.0))
    assert optimum.poles[0] == pytest.approx(-math.sqrt(2.0))
    # x[k+1] = x + u: p = (1 + sqrt(5)) / 2, K = p / (1 + p); a mixed term N = R K₀ shifts the gain by K₀.
    golden = 0.5 * (1.0 + math.sqrt(5.0))
    found = riccati.sampled(riccati.SampledModel(one, one, one, 0.0 * one, one))
    assert found.gain[0, 0] == pytest.approx(golden / (1.0 + golden))
    a_shift, k0 = 1.5 * one, 0.5
    shifted = riccati.sampled(riccati.SampledModel(a_shift, one, one * (1.0 + k0**2), k0 * one, one))
    assert shifted.gain[0, 0] == pytest.approx(golden / (1.0 + golden) + k0)


def test_second_simulation_sampled_stays_where_it_hovers() -> None:
    vehicle = vehicle_with("1")
    gain, _ = linear_model.gains(vehicle, integral=True)
    law = second.Law(
        0.1 * gain,
        linear_model.hover_point(vehicle),
        np.array([vehicle.hover_thrust, 0.0, 0.0, 0.0]),
        lambda _: (0, 0, 0),
    )
    run = second.fly_sampled(vehicle, law, 0.004, 50, steps=2)
    assert not run.diverged
    assert run.time[-1] == pytest.approx(0.2)
    assert np.abs(run.states - run.states[0]).max() < 1e-9


def test_a_value_that_is_not_finite_is_no_number() -> None:
    ledger = Ledger()
    ledger.check("x", float("nan"), 0.0, 1.0)
    assert ledger.outside == ["x"]
    assert ledger.document()["x"] is None


def test_exact_rank() -> None:
    third = Fraction(1, 3)
    assert controllability.rank([[third, 1 - third], [Fraction(1), Fraction(2)]]) == 1
    assert controllability.rank([[third, third], [Fraction(1), Fraction(2)]]) == 2


def test_second_simulation_turns_its_state_back_and_forth() -> None:
    x = np.array([1.0, 2, 3, -1, 0.5, 0.2, 0.3, -0.4, 0.5, 0.6, 0.7, -0.8, 0.1, 0.2, 0.3, 0.4, -0.5, 0.6])
    assert second.eq31(second.from_eq31(x)) == pytest.approx(x.tolist(), abs=1e-12)


def test_second_simulation_hovers() -> None:
    vehicle = load_vehicle("paper")
    rate = second.derivative(vehicle, second.initial_state(vehicle), (vehicle.hover_thrust, 0.0, 0.0, 0.0))
    assert np.abs(rate).max() < 1e-12


@pytest.mark.parametrize("key", [*elasticity.OTHERS, "cable.stiffness"])
def test_a_sweep_draws_the_vehicles_that_it_says(key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    values = elasticity.STIFFNESSES if key == "cable.stiffness" else elasticity.OTHERS[key][1]
    monkeypatch.setattr(stiffness, "respond", lambda vehicle: vehicle)
    assert stiffness.swept(key, values) == {value: stiffness.on(f"{key}={value!r}") for value in values}
