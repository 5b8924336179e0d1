"""Translated kernels are kept, and only those are translated again that an edit changes."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.compiled.sample import SOURCE, Sample, code_files, kernel_files
from tests.patience import PATIENCE

CALLERS_OF_WAVE = ["alone", "apply", "wave"]
ALL = ["alone", "apply", "element", "ratio", "wave"]


class Home:
    """A copy of the sample's cache, and its processes."""

    def __init__(self, sample: Sample, home: Path) -> None:
        self._sample, self.home = sample, home
        self.cache = home / "sitl-bridge"
        shutil.copytree(sample.cache, self.cache)

    def compile(self) -> str:
        """Compile what is missing; returns what the sample then gives."""
        process = self._sample.start(XDG_CACHE_HOME=str(self.home))
        out, err = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, err
        return out

    def edit(self, before: str, after: str) -> None:
        assert before in SOURCE
        self._sample.source.write_text(SOURCE.replace(before, after))

    def restore(self) -> None:
        self._sample.source.write_text(SOURCE)

    def kernels(self) -> list[str]:
        """Names of the kernels in the cache, one for each of its contents."""
        return sorted(file.name.split(".")[1] for file in kernel_files(self.cache))


@pytest.fixture
def home(sample: Sample, tmp_path: Path) -> Iterator[Home]:
    home = Home(sample, tmp_path / "home")
    yield home
    home.restore()


def test_each_kernel_is_kept_once(home: Home) -> None:
    assert home.kernels() == ALL


@pytest.mark.parametrize(
    ("before", "after", "changed"),
    [
        ("SCALE * math.sin(x)", "SCALE * math.cos(x)", CALLERS_OF_WAVE),
        ("SCALE = 3.0", "SCALE = 4.0", CALLERS_OF_WAVE),
        ("return a / b", "return b / a", ["ratio"]),
    ],
    ids=["kernel", "constant", "entry point"],
)
def test_an_edit_translates_only_what_it_changes(
    home: Home, before: str, after: str, changed: list[str]
) -> None:
    home.edit(before, after)
    home.compile()
    assert home.kernels() == sorted(ALL + changed)


def test_from_kept_kernels_comes_the_same_machine_code(home: Home, sample: Sample) -> None:
    (first,) = code_files(home.cache)
    content = first.read_bytes()
    first.unlink()
    assert home.compile() == sample.outcomes[0][0]
    assert first.read_bytes() == content
    assert home.kernels() == ALL


@pytest.mark.parametrize("damaged", ["wave", "alone"])
def test_a_damaged_kernel_and_one_that_is_gone_are_translated_again(
    home: Home, sample: Sample, damaged: str
) -> None:
    (code,) = code_files(home.cache)
    (file,) = home.cache.glob(f"kernel.{damaged}.*")
    content = file.read_bytes()
    for broken in (content[:-1], b"", None):
        code.unlink()
        file.unlink()
        if broken is not None:
            file.write_bytes(broken)
        assert home.compile() == sample.outcomes[0][0]
        assert file.read_bytes() not in (b"", broken)
