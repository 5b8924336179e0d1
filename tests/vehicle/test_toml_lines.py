"""The line of a key is found in any TOML."""

from __future__ import annotations

import pytest

from sitl_bridge.vehicle.toml_lines import key_lines, line_of

TEXT = '''# a comment
name = "x"
about = """
[not.a.table]
name = 3
"""

[airframe]
inertia = [
  1.0,  # two
  2.0,
]
drag.linear = 1.0
[airframe.more]
"a key" = {inside = 1, other = [1, 2]}

[[rotors]]
direction = "cw"
[[rotors]]
direction = "ccw"
[rotors.tip]
speed = 3
'''


@pytest.mark.parametrize(
    ("location", "line"),
    [
        (("name",), 2),
        (("about",), 3),
        (("airframe",), 8),
        (("airframe", "inertia"), 9),
        (("airframe", "inertia", 1), 9),
        (("airframe", "drag", "linear"), 13),
        (("airframe", "more", "a key", "inside"), 15),
        (("rotors", 0, "direction"), 18),
        (("rotors", 1, "direction"), 20),
        (("rotors", 1, "tip", "speed"), 22),
        (("rotors", 1, "max_speed"), 19),  # where it is missing
        (("airframe", "mass"), 8),
        (("nowhere",), None),
        ((), None),
    ],
)
def test_a_key_is_in_its_line(location: tuple[int | str, ...], line: int | None) -> None:
    assert line_of(TEXT, location) == line


def test_a_table_in_a_text_is_none() -> None:
    assert ("not",) not in key_lines(TEXT)
