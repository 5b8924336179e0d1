"""Settings of every test."""

from typing import Any

import pytest
from hypothesis import settings

# No deadline: a busy machine is no fault. The same examples each time: a failure is never the weather's;
# `--hypothesis-profile=search` looks for new ones.
settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=50)
settings.register_profile("search", deadline=None, max_examples=1000)
settings.load_profile("repeatable")

STATIONS = "tests/loopback/stations/"


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With several workers (`-n 2`) one flies with ground stations, which mostly wait; the others compute.

    No two flights with stations are ever under way together, and what a module has set up is set up once.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFolder(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return STATIONS if nodeid.startswith(STATIONS) else nodeid.split("::")[0]

    return ByFolder(config, log)
