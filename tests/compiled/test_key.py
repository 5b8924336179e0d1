"""What compiles again, and what does not."""

from pathlib import Path
from typing import Any

import pytest

from sitl_bridge.compiled import kernel, key, load
from tests.compiled.sample import NAME, SOURCE, Sample, code_files, fresh, loaded, put


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
    assert before in SOURCE
    try:
        sample.source.write_text(SOURCE.replace(before, after))
        for _ in range(2):
            fresh()
            load(NAME)
        assert compilations == ([NAME] if compiles else [])
    finally:
        sample.source.write_text(SOURCE)


def test_a_moved_checkout_compiles_nothing(
    cache: Path, compilations: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / f"{NAME}.py").write_text("# moved\n" + SOURCE)
    monkeypatch.syspath_prepend(tmp_path)
    assert loaded().__file__ == str(tmp_path / f"{NAME}.py")
    assert compilations == []


def test_a_text_that_is_no_docstring_counts() -> None:
    def described(text: str) -> str:
        scope: dict[str, Any] = {}
        exec(f"def f(x):\n    return {text!r}\ng = lambda x: {text!r}", scope)
        return key.kernel_digest(kernel(scope["f"])) + key.kernel_digest(kernel(scope["g"]))

    one, other = described("one"), described("other")
    assert one[:64] != other[:64]
    assert one[64:] != other[64:]
    assert described("one") == one


def test_machines_do_not_share_code_nor_overwrite_each_others(
    cache: Path, compilations: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    here = key.machine()
    monkeypatch.setattr(key, "machine", lambda: f"{here} another-feature")
    loaded()
    assert compilations == [NAME]
    one, other = code_files(cache)
    monkeypatch.setattr(key, "machine", lambda: here)
    loaded()
    assert compilations == [NAME]
    # A file under this machine's name with another's contents is not believed.
    one_content, other_content = one.read_bytes(), other.read_bytes()
    put(one, other_content)
    put(other, one_content)
    loaded()
    assert compilations == [NAME] * 2
