"""Forked children: what an interpreter of its own would do, and nothing of the parent's."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere nothing is forked")

PARENT = """
import atexit, json, os, signal, subprocess, sys, threading, time
from pathlib import Path
from sitl.command_line import commands
from sitl.flights.child import Forked, can_fork
from sitl.flights.free_ports import free_ports
from sitl_bridge.process import StopRequest

StopRequest().install()
atexit.register(print, "the parent's own")
print("once", end="")  # in our buffer when we fork
shown = {"can": can_fork()}
wrong = Forked(["vehicle", "check", "nowhere.toml"], None)
shown["wrong"] = wrong.wait(60.0)
said = Forked(["--version"], None)
shown["said"] = [said.stdout.read().decode(), said.wait(60.0)]

first, second = (["plant", "--hil", f"udpin:127.0.0.1:{port}", "--until-eof"] for port in free_ports(2))
waits, other = Forked(first, None), Forked(second, None)
deadline = time.monotonic() + 60.0
while (words := Path(f"/proc/{waits.pid}/cmdline").read_bytes().split(b"\\0"))[0] != b"sitl":
    assert time.monotonic() < deadline
shown["shown as"] = b" ".join(words).decode().rstrip("\\0 ") == " ".join(["sitl", *first])
shown["running"] = waits.poll()
try:
    waits.wait(0.0)
except subprocess.TimeoutExpired:
    shown["late"] = True
waits.stdin.close()  # nobody else may hold its other end, or it would not notice
shown["closed"] = waits.wait(60.0)
other.terminate()
shown["terminated"] = other.wait(60.0)
gone = Forked(first, None)
gone.kill()
shown["killed"] = gone.wait(60.0)
threading.Thread(target=threading.Event().wait, daemon=True).start()
shown["with a thread"] = can_fork()
print(json.dumps(shown))
"""


def test_a_forked_child_is_as_one_of_its_own() -> None:
    done = subprocess.run([sys.executable, "-c", PARENT], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    first, last = done.stdout.splitlines()
    assert last == "the parent's own"
    assert first.startswith("once{")
    shown = json.loads(first.removeprefix("once"))
    assert shown["can"]
    assert not shown["with a thread"]
    assert shown["wrong"] == 2
    assert "nowhere.toml" in done.stderr
    version, code = shown["said"]
    assert version.startswith("sitl")
    assert code == 0
    assert shown["shown as"]
    assert shown["running"] is None
    assert shown["late"]
    assert shown["closed"] == 0
    assert shown["terminated"] in (0, -15)  # or before it takes signals over
    assert shown["killed"] == -9
    assert "Traceback" not in done.stderr
