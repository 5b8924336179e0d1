"""Settings of every test."""

from hypothesis import settings

# No deadline: a busy machine is no fault. The same examples each time: a failure is never the weather's;
# `--hypothesis-profile=search` looks for new ones.
settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=50)
settings.register_profile("search", deadline=None, max_examples=1000)
settings.load_profile("repeatable")
