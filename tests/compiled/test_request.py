"""Compilation in a process of its own: side by side, refused, ended, and where nothing can be kept."""

import signal
from pathlib import Path

import pytest

from sitl_bridge.compiled import cache as caching
from sitl_bridge.compiled import compile_missing, load, missing
from tests.compiled.sample import NAME, SOURCE, Sample, code_files, fresh
from tests.patience import PATIENCE

ALLOCATES = """
import numpy as np
from sitl_bridge.compiled import Buffer, entry_point

@entry_point(Buffer(np.float64, (4,)), int)
def allocating(out, count):
    out[0] = np.zeros(count).sum()
    return 0
"""

RAISES = """
from sitl_bridge.compiled import entry_point

@entry_point(int)
def raising(number):
    if number < 0:
        raise ValueError("negative")
    return number
"""

CALLS = """
from sitl_bridge.compiled import entry_point

@entry_point(int)
def early(number):
    return number

early(3)
"""

UNTYPED = """
from sitl_bridge.compiled import entry_point

@entry_point(int)
def untyped(number):
    return number + "one"
"""


def test_two_processes_compile_at_once_without_compiler_or_llvm_in_either(sample: Sample) -> None:
    answers = set()
    for out, err, status in sample.outcomes:
        assert status == 0, err
        assert err == f"compiling 1 of 1: {NAME}\n"
        answers.add(out)
    assert len(answers) == 1
    assert len(code_files(sample.cache)) == 1


def test_a_computer_without_linker_keeps_the_object_file(sample: Sample, tmp_path: Path) -> None:
    home = tmp_path / "home"
    runs = [sample.start("without linker", PATH=str(tmp_path), XDG_CACHE_HOME=str(home)) for _ in range(2)]
    outs = [run.communicate(timeout=PATIENCE) for run in runs]
    assert [run.returncode for run in runs] == [0, 0], outs
    assert {out for out, _ in outs} == {sample.outcomes[0][0]}
    assert [file.suffix for file in code_files(home / "sitl-bridge")] == [".o"]


def test_it_works_where_nothing_can_be_kept(sample: Sample, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    (temporary / f"sitl-bridge-{caching.os.getuid()}").touch()
    run = sample.start(XDG_CACHE_HOME=str(tmp_path / "file"), TMPDIR=str(temporary))
    out, err = run.communicate(timeout=PATIENCE)
    assert run.returncode == 0, err
    assert out == sample.outcomes[0][0]
    assert err.endswith(f"no place to keep the compiled {NAME}: each start compiles it\n")
    assert len(list(temporary.iterdir())) == 1, "only what stood in the way is left"


@pytest.mark.parametrize(
    ("name", "source", "message"),
    [
        ("native_allocates", ALLOCATES, r"allocating allocates memory"),
        ("native_raises", RAISES, r"raising may raise an exception"),
        ("native_calls", CALLS, r"an entry point of native_calls is called while"),
        ("native_untyped", UNTYPED, r"No implementation of function .*add"),
    ],
)
def test_refused(
    name: str, source: str, message: str, cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / f"{name}.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(RuntimeError, match=message) as caught:
        load(name)
    assert f"compiling {name} failed" in str(caught.value)
    assert not list(cache.glob(f"{name}*.[so]*"))


@pytest.mark.parametrize(
    ("number", "error", "message"),
    [
        (signal.SIGTERM, KeyboardInterrupt, "^$"),  # to a whole group of processes, as by `timeout`
        (signal.SIGKILL, RuntimeError, "compiling native_killed was killed by SIGKILL"),
    ],
)
def test_a_compilation_that_is_ended_loses_only_the_module_under_way(
    number: signal.Signals,
    error: type[BaseException],
    message: str,
    cache: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    killed = tmp_path / "native_killed.py"
    killed.write_text(
        "import os\nfrom sitl_bridge.compiled import entry_point, request\n"
        f"if os.environ.get(request.COMPILING):\n    os.kill(os.getpid(), {int(number)})\n"
        "@entry_point(int)\ndef late(number):\n    return number\n"
    )
    (tmp_path / "native_early.py").write_text(SOURCE)
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("native_early", "native_killed"):
        fresh(name)
    with pytest.raises(error, match=message):
        compile_missing(missing(["native_early", "native_killed"]))
    assert [file.name.partition(".")[0] for file in code_files(cache)] == ["native_early", NAME]


def test_a_module_that_cannot_be_compiled_does_not_keep_others_from_it(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "native_bad.py").write_text(RAISES)
    (tmp_path / "native_good.py").write_text(SOURCE)
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("native_bad", "native_good"):
        fresh(name)
    with pytest.raises(RuntimeError, match="compiling native_bad failed"):
        compile_missing(missing(["native_bad", "native_good"]))
    assert [file.name.partition(".")[0] for file in code_files(cache)] == ["native_good", NAME]


def test_a_killed_process_leaves_what_its_compiler_is_about_to_finish(sample: Sample, tmp_path: Path) -> None:
    home = tmp_path / "home"
    run = sample.start(XDG_CACHE_HOME=str(home))
    assert run.stderr is not None
    assert run.stderr.readline() == f"compiling 1 of 1: {NAME}\n"
    run.kill()
    run.wait()
    again = sample.start(XDG_CACHE_HOME=str(home))  # waits for the other's compiler, which has the lock
    out, err = again.communicate(timeout=PATIENCE)
    assert (again.returncode, out) == (0, sample.outcomes[0][0]), err
    assert len(code_files(home / "sitl-bridge")) == 1
