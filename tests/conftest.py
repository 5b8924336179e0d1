"""Settings of every test."""

import os
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

# As `sitl` itself has it, and before NumPy is there: threads for matrices of 20 rows only spin.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# No deadline, and no complaint of slow data: a busy machine is no fault. The same examples each time: a
# failure is never the weather's; `--hypothesis-profile=search` looks for new ones.
SLOW = [HealthCheck.too_slow]
settings.register_profile(
    "repeatable", deadline=None, derandomize=True, max_examples=50, suppress_health_check=SLOW
)
settings.register_profile("search", deadline=None, max_examples=1000, suppress_health_check=SLOW)
settings.load_profile("repeatable")


@pytest.fixture(autouse=True)
def _as_a_process_begins() -> Iterator[None]:
    """A command that a test calls in this process does not decide for others where results and rows go."""
    yield
    for module, name, at_first in (
        ("controller.design.kept", "_on_disk", False),
        ("sitl_bridge.rowlog", "_apart", None),
    ):
        if module in sys.modules:
            setattr(sys.modules[module], name, at_first)


STATIONS = "tests/loopback/stations/"
LONG = (
    STATIONS,
    "tests/sitl/studies/test_paper.py",
    "tests/sitl/studies/",
    "tests/sitl/flights/test_in_process.py",
    "tests/loopback/",
    "tests/flights/",
    "tests/controller/ground/",
    "tests/estimator/",
    "tests/over/",
    "tests/docs/",
)
"""What takes tens of seconds and more, begun first: at the end no worker waits for another's long one."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long ones first, else in order."""
    last = len(LONG)
    items.sort(key=lambda item: next((i for i, at in enumerate(LONG) if item.nodeid.startswith(at)), last))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With three workers on two cores one flies with ground stations and mostly waits; two compute.

    No two flights with stations are ever under way together, and what a module has set up is set up once.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFolder(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return STATIONS if nodeid.startswith(STATIONS) else nodeid.split("::")[0]

    config.option.loadscopereorder = False  # by the number of tests; ours are in order
    return ByFolder(config, log)
