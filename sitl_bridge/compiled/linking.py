"""From an object file to a shared library, where this computer has a linker."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from importlib import util
from pathlib import Path

from sitl_bridge.compiled.cache import OBJECT, SHARED_LIBRARY

_COMPILERS = ("cc", "gcc", "clang")
_LINKERS = ("ld", "ld.lld", "mold")


def linked(code: bytes) -> tuple[str, bytes]:
    """Kind and contents of the file to keep: a shared library, or the object file itself.

    code: an object file that needs nothing but the C library's mathematics.
    """
    if sys.platform == "linux":
        for command in _commands():
            library = _shared_library(command, code)
            if library is not None:
                return SHARED_LIBRARY, library
    return OBJECT, code


def _commands() -> list[list[str]]:
    """Beginnings of command lines that link, on this computer."""
    compilers = [[path, "-nostdlib"] for path in map(shutil.which, _COMPILERS) if path]
    linkers = [[path] for path in map(shutil.which, _LINKERS) if path]
    package = [[sys.executable, "-m", "ziglang", "cc", "-nostdlib"]] if util.find_spec("ziglang") else []
    return compilers + linkers + package


def _shared_library(command: list[str], code: bytes) -> bytes | None:
    with tempfile.TemporaryDirectory(prefix="sitl-bridge-") as folder:
        source, target = Path(folder, "code.o"), Path(folder, "code.so")
        source.write_bytes(code)
        # Against the C library of this process: an older one's `pow` is another function.
        whole = [*command, "-shared", "-o", str(target), str(source), *_mathematics()]
        outcome = subprocess.run(whole, stdin=subprocess.DEVNULL, capture_output=True, check=False)
        return target.read_bytes() if outcome.returncode == 0 else None


def _mathematics() -> list[str]:
    """The file of the C library's mathematics that this process has loaded."""
    maps = Path("/proc/self/maps").read_text(errors="replace")
    paths = (line.split(maxsplit=5)[5] for line in maps.splitlines() if line.count("/"))
    return [path for path in dict.fromkeys(paths) if Path(path).name.startswith(("libm.", "libm-"))]
