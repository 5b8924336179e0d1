"""`[law]` of a description: factors on the weights of every shipped design."""

from __future__ import annotations

import numpy as np
import pytest

from controller.design.catalogue import Emphasis, default_weights, design, guided_designs
from controller.design.names import DESIGNS, ON_ESTIMATE
from sitl_bridge.vehicle.files import DescriptionError, load_vehicle

EVERYTHING = [f"law.{name}=4.0" for name in Emphasis._fields]


@pytest.mark.parametrize("name", [*DESIGNS, ON_ESTIMATE])
def test_a_factor_on_the_whole_cost_changes_no_gain(name: str) -> None:
    plain, scaled = (design(name, load_vehicle("paper", more), 250.0) for more in ([], EVERYTHING))
    for gain in ("state_gain", "integral_gain"):
        largest = np.abs(plain[gain]).max()
        np.testing.assert_allclose(scaled[gain], plain[gain], atol=1e-6 * max(1.0, largest))


@pytest.mark.parametrize("name", [*DESIGNS, ON_ESTIMATE])
def test_dearer_inputs_are_used_less(name: str) -> None:
    gains = [
        np.linalg.norm(design(name, load_vehicle("paper", more), 250.0)["state_gain"])
        for more in ([], ["law.thrust=100", "law.moments=100"])
    ]
    assert gains[1] < 0.9 * gains[0]


def test_it_is_what_the_parameters_of_ground_control_do() -> None:
    by_file = guided_designs(load_vehicle("iris", ["law.load_position=3", "law.moments=0.5"]), 250.0)
    by_parameter = guided_designs(load_vehicle("iris"), 250.0, Emphasis(load_position=3.0, moments=0.5))
    for one, other in zip(by_file, by_parameter, strict=True):
        np.testing.assert_array_equal(one["state_gain"], other["state_gain"])
        np.testing.assert_array_equal(one["integral_gain"], other["integral_gain"])


def test_the_file_has_the_names_of_the_design() -> None:
    vehicle = load_vehicle("paper")
    assert tuple(type(vehicle.law).model_fields) == Emphasis._fields
    assert np.array_equal(default_weights(vehicle).Q, default_weights(vehicle, Emphasis()).Q)


@pytest.mark.parametrize("bad", ["law.thrust=0", "law.thrust=1e4", "law.thrust=much", "law.thrsut=2"])
def test_bad_values_are_one_line(bad: str) -> None:
    with pytest.raises(DescriptionError) as raised:
        load_vehicle("paper", [bad])
    assert "law.thr" in str(raised.value)
    assert str(raised.value).count("\n") <= 1
