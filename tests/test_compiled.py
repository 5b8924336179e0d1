"""Compiled functions: what is refused, and when the cache is believed."""

import importlib
import os
import signal
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from sitl_bridge import compiled

SAMPLE = '''
import math

import numpy as np

from sitl_bridge.compiled import Buffer, entry_point, kernel

SCALE = 3.0
RECORD = np.dtype([("gain", "f8"), ("on", "b1"), ("table", "f8", 4)])


@kernel
def wave(x):
    return SCALE * math.sin(x) + math.hypot(x, 1.0)


@entry_point(Buffer(RECORD, (1,)), Buffer(np.float64, (4,)), int, float)
def apply(record, out, rounds, x):
    """Add waves to `out`, return how many."""
    p = record[0]
    for k in range(rounds):
        for i in range(4):
            out[i] += p.gain * p.table[i] * wave(x + k) ** 1.5 if p.on else wave(x * k) - i
    return rounds * 4


@entry_point(float, returns=float)
def alone(x):
    return wave(x) ** 2


@entry_point(float, float, returns=float)
def ratio(a, b):
    return a / b
'''

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

IN_ANOTHER_PROCESS = """
import sys
from pathlib import Path
from sitl_bridge import compiled
compiled._cache_directories = lambda: [Path(sys.argv[1])]
import native_sample
print(native_sample.alone(0.25))
assert "numba" not in sys.modules
"""


class Sample:
    """A module of entry points in a directory of its own, with a cache of its own."""

    def __init__(self, folder: Path) -> None:
        self.cache = folder / "cache"
        self.source = folder / "native_sample.py"
        self.source.write_text(SAMPLE)
        command = [sys.executable, "-c", IN_ANOTHER_PROCESS, str(self.cache)]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), *sys.path])}
        environment["PYTHONDONTWRITEBYTECODE"] = "1"  # the source changes faster than its time stamp tells
        two = [
            subprocess.Popen(
                command, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
            )
            for _ in range(2)
        ]
        self.outcomes = [(*process.communicate(timeout=120), process.returncode) for process in two]

    def entry(self) -> Path:
        (file,) = self.cache.iterdir()
        return file


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Sample]:
    """Compiled once, by two processes at the same time."""
    folder = tmp_path_factory.mktemp("sample")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        patch.setattr(sys, "dont_write_bytecode", True)
        yield Sample(folder)


@pytest.fixture
def compilations(monkeypatch: pytest.MonkeyPatch, sample: Sample) -> list[str]:
    """The modules compiled so far; compiling gives what compiling the sample gave, for today's source."""
    done: list[str] = []
    code = sample.entry().read_bytes().partition(b"\n")[2]

    def compile_again(module: str) -> bytes:
        done.append(module)
        return compiled._packed(code, compiled._key(module))

    monkeypatch.setattr(compiled, "_compile", compile_again)
    return done


@pytest.fixture
def cache(monkeypatch: pytest.MonkeyPatch, sample: Sample, tmp_path: Path) -> Path:
    """A private copy of the sample's cache, the only one that is looked at."""
    directory = tmp_path / "cache"
    directory.mkdir(mode=0o755)
    (directory / sample.entry().name).write_bytes(sample.entry().read_bytes())
    monkeypatch.setattr(compiled, "_cache_directories", lambda: [directory])
    return directory


def fresh() -> ModuleType:
    """The sample as a process that has just started imports it."""
    sys.modules.pop("native_sample", None)
    compiled._engines.pop("native_sample", None)
    importlib.invalidate_caches()
    return importlib.import_module("native_sample")


def loaded() -> ModuleType:
    """The sample as a process that has just started has it."""
    module = fresh()
    assert module.alone(0.25) == pytest.approx(module.alone.python(0.25), rel=1e-15)
    return module


def test_two_processes_compile_at_once_without_numba_in_either(sample: Sample) -> None:
    answers = set()
    for out, err, status in sample.outcomes:
        assert status == 0, err
        assert err == "compiling native_sample, once\n"
        answers.add(out)
    assert len(answers) == 1
    name = compiled._file_name("native_sample", compiled._key("native_sample"))
    assert [file.name for file in sample.cache.iterdir()] == [name]


def test_plain_python_and_compiled_give_the_same_numbers(sample: Sample, cache: Path) -> None:
    module = loaded()
    for on in (False, True):
        record = np.zeros(1, dtype=module.RECORD)
        record[0] = (1.7, on, [1, -2, 3, 0.5])
        one, other = np.ones(4), np.ones(4)
        bound = module.apply.bind(record, one)
        assert bound(3, 0.3) == 12
        assert module.apply.python(record.view(np.recarray), other, 3, 0.3) == 12
        np.testing.assert_allclose(one, other, rtol=1e-15)
        assert module.apply(record, one, 0, 0.3) == 0
    assert module.ratio(1.0, 0.0) == np.inf  # compiled code does not raise; numpy's rules


def test_a_second_load_compiles_nothing(cache: Path, compilations: list[str]) -> None:
    loaded()
    loaded()
    assert compilations == []


@pytest.mark.parametrize(
    ("before", "after", "compiles"),
    [
        ('"""Add waves to `out`, return how many."""', '"""Add."""  # and a comment', False),
        ("return wave(x) ** 2", "return (\n        wave(x) ** 2\n    )", False),
        ("import math\n", "import math\nimport os\n\nUNUSED = os.sep\n", False),
        ("return wave(x) ** 2", "return wave(x) ** 3", True),
        ("SCALE = 3.0", "SCALE = 3.0000000000000004", True),
        ("return SCALE * math.sin(x)", "return SCALE * math.cos(x)", True),
        ('("on", "b1")', '("on", "i1")', True),
        ("@kernel\n", "from sitl_bridge.compiled import vector_kernel\n\n@vector_kernel\n", True),
        ("Buffer(np.float64, (4,))", "Buffer(np.float64, (5,))", True),
    ],
    ids=["words", "format", "unused", "entry", "constant", "kernel", "record", "decorator", "shape"],
)
def test_only_a_change_of_what_is_compiled_compiles_again(
    sample: Sample, cache: Path, compilations: list[str], before: str, after: str, compiles: bool
) -> None:
    assert before in SAMPLE
    try:
        sample.source.write_text(SAMPLE.replace(before, after))
        fresh()
        compiled.load("native_sample")
        fresh()
        compiled.load("native_sample")
        assert compilations == (["native_sample"] if compiles else [])
    finally:
        sample.source.write_text(SAMPLE)


def test_a_moved_checkout_compiles_nothing(
    cache: Path, compilations: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "native_sample.py").write_text("# moved\n" + SAMPLE)
    monkeypatch.syspath_prepend(tmp_path)
    assert loaded().__file__ == str(tmp_path / "native_sample.py")
    assert compilations == []


def test_machines_do_not_share_entries_nor_overwrite_each_others(
    cache: Path, compilations: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    here = compiled._machine()
    monkeypatch.setattr(compiled, "_machine", lambda: f"{here} +another-feature")
    loaded()
    assert compilations == ["native_sample"]
    other = compiled._key("native_sample")
    monkeypatch.setattr(compiled, "_machine", lambda: here)
    loaded()
    assert compilations == ["native_sample"]
    # An entry under this machine's name that says it is another's is not believed.
    key = compiled._key("native_sample")
    for file in cache.iterdir():
        file.write_bytes(file.read_bytes().replace(key.encode(), other.encode(), 1))
    loaded()
    assert compilations == ["native_sample"] * 2


@pytest.mark.parametrize(
    "damage",
    [
        lambda entry: b"",
        lambda entry: b"[]\n",
        lambda entry: b"{}\n",
        lambda entry: entry[:-1],
        lambda entry: entry[:-100] + bytes([entry[-100] ^ 1]) + entry[-99:],
    ],
    ids=["empty", "list", "object", "cut", "bit"],
)
def test_a_damaged_entry_is_replaced(cache: Path, compilations: list[str], damage: Any) -> None:
    (file,) = cache.iterdir()
    file.write_bytes(damage(file.read_bytes()))
    loaded()
    loaded()
    assert compilations == ["native_sample"]


def test_code_is_loaded_only_from_directories_that_others_cannot_write(
    cache: Path, compilations: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    (file,) = cache.iterdir()
    untouched = file.stat()
    cache.chmod(0o777)
    loaded()
    assert compilations == ["native_sample"]
    assert "no place to keep the compiled native_sample" in capfd.readouterr().err
    assert file.stat() == untouched


def test_a_link_or_another_users_directory_is_not_trusted(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert compiled._trusted(cache)
    link = tmp_path / "link"
    link.symlink_to(cache)
    assert not compiled._trusted(link)
    monkeypatch.setattr(os, "getuid", lambda: cache.stat().st_uid + 1)
    assert not compiled._trusted(cache)


def test_the_temporary_directory_itself_is_no_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")  # to be ignored, says the specification
    monkeypatch.setattr(compiled.tempfile, "gettempdir", lambda: str(tmp_path))
    assert compiled._cache_directories() == [tmp_path / f"sitl-bridge-{os.getuid()}"]


def test_it_works_where_nothing_can_be_written(
    compilations: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr(compiled, "_cache_directories", lambda: [tmp_path / "file" / "cache"])
    loaded()
    assert compilations == ["native_sample"]
    assert "each start compiles it" in capfd.readouterr().err


def test_the_next_directory_serves_where_the_first_cannot_be_written(
    compilations: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    second = tmp_path / "new" / "cache"
    monkeypatch.setattr(compiled, "_cache_directories", lambda: [tmp_path / "file" / "cache", second])
    loaded()
    loaded()
    assert compilations == ["native_sample"]
    assert len(list(second.iterdir())) == 1


@pytest.mark.parametrize(
    ("name", "source", "message"),
    [
        ("native_allocates", ALLOCATES, r"allocating allocates or raises: it needs .*NRT_"),
        ("native_raises", RAISES, r"raising allocates or raises: it needs .*gil"),
        ("native_calls", CALLS, r"an entry point of native_calls is called while"),
    ],
)
def test_refused(
    name: str, source: str, message: str, cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / f"{name}.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(RuntimeError, match=message) as caught:
        compiled._cached_object(name)
    assert f"compiling {name} failed" in str(caught.value)
    assert not list(cache.glob(f"{name}*"))


@pytest.mark.parametrize(
    ("number", "error", "message"),
    [
        (signal.SIGTERM, KeyboardInterrupt, "^$"),  # to a whole group of processes, as by `timeout`
        (signal.SIGKILL, RuntimeError, "compiling native_killed was killed by SIGKILL"),
    ],
)
def test_a_compilation_that_is_ended_is_no_failure_of_the_code(
    number: signal.Signals,
    error: type[BaseException],
    message: str,
    cache: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "native_killed.py").write_text(
        "import os\nfrom sitl_bridge import compiled\n"
        f"if os.environ.get(compiled._COMPILING):\n    os.kill(os.getpid(), {int(number)})\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(error, match=message):
        compiled._cached_object("native_killed")
    assert not list(cache.glob("native_killed*"))


def test_bind_refuses_other_arrays(cache: Path) -> None:
    module = loaded()
    record, out = np.zeros(1, dtype=module.RECORD), np.zeros(4)
    read_only = np.zeros(4)
    read_only.flags.writeable = False
    for bad, words in [
        (np.zeros(4, dtype=np.float32), r"argument 1 is float32\(4,\), expected Buffer"),
        (np.zeros(5), r"float64\(5,\)"),
        (np.zeros((4, 1)), r"float64\(4, 1\)"),
        (np.zeros(8)[::2], "not contiguous"),
        (read_only, "writeable"),
        ([0.0] * 4, "argument 1 is list"),
    ]:
        with pytest.raises(TypeError, match=words):
            module.apply.bind(record, bad)
        with pytest.raises(TypeError, match=words):
            module.apply(record, bad, 1, 1.0)
    with pytest.raises(TypeError, match="1 arrays, expected 2"):
        module.apply.bind(record)
    with pytest.raises(TypeError, match="3 arrays, expected 2"):
        module.apply.bind(record, out, out)
    with pytest.raises(struct.error, match="expected 2 items"):
        module.apply.bind(record, out)(1)
    with pytest.raises(struct.error, match="not an integer"):
        module.apply.bind(record, out)(1.5, 1.0)


def test_bound_arrays_live_as_long_as_what_they_are_bound_to(cache: Path) -> None:
    module = loaded()
    bound = module.apply.bind(np.zeros(1, dtype=module.RECORD), np.zeros(4))
    assert bound(1, 0.5) == 4
    assert bound.keeps[0][1][0] == module.wave(0.0)


def test_an_entry_point_that_is_no_attribute_of_its_module_is_named(cache: Path) -> None:
    module = loaded()
    lost = compiled.entry_point(float, returns=float)(lambda x: x)
    lost.python.__module__ = module.__name__
    lost.name = "lost"
    with pytest.raises(RuntimeError, match="native_sample has no entry point lost"):
        lost(1.0)
