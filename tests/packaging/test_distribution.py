"""What is built from the checkout: complete, valid, and at work in an environment of its own.

The fresh environment takes the required packages from the running one, so that nothing is downloaded. An
audit hook in it forbids what a read-only installation without a network forbids.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from email.message import Message
from email.parser import Parser
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
PROJECT = tomllib.loads((TOP / "pyproject.toml").read_text(encoding="utf-8"))["project"]
LEFT_OUT = shutil.ignore_patterns(".git", ".venv", "__pycache__", ".*_cache", ".hypothesis", "runs", "site")
GUARD = """
import os, sys
ENVIRONMENT = os.path.realpath(sys.prefix)
def guard(event, arguments):
    if event == "socket.connect" and isinstance(arguments[1], tuple) and arguments[1][0] != "127.0.0.1":
        raise OSError(f"the network is not to be used: {arguments[1]}")
    if event == "open" and isinstance(arguments[0], str) and arguments[2] & (os.O_WRONLY | os.O_RDWR):
        if os.path.realpath(arguments[0]).startswith(ENVIRONMENT):
            raise OSError(f"the installation is not to be written: {arguments[0]}")
sys.addaudithook(guard)
"""


def _files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def _run(*command: str | Path, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    without_sources = {name: text for name, text in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [str(word) for word in command],
        cwd=cwd,
        env={**without_sources, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done


class Built:
    """A copy of the checkout, and what was built from it."""

    def __init__(self, folder: Path) -> None:
        self.source, dist = folder / "source", folder / "dist"
        shutil.copytree(TOP, self.source, ignore=LEFT_OUT)
        self.before = _files(self.source)
        build = [sys.executable, "-m", "build", "--no-isolation", "--outdir"]
        _run(*build, dist, "--sdist", "--wheel", self.source, cwd=folder)
        [self.sdist], [self.wheel] = dist.glob("*.tar.gz"), dist.glob("*.whl")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    return Built(tmp_path_factory.mktemp("built"))


@pytest.fixture(scope="module")
def fresh(built: Built, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Python of an environment with the wheel, whose required packages are those of this one."""
    folder = tmp_path_factory.mktemp("fresh")
    venv.create(folder / "venv", with_pip=False)
    python = folder / "venv/bin/python"
    install = [sys.executable, "-m", "pip", f"--python={python}", "install", "--no-deps", "--no-index"]
    _run(*install, "--quiet", built.wheel, cwd=folder)
    [site] = (folder / "venv/lib").glob("python*/site-packages")
    (site / "shared.pth").write_text(sysconfig.get_path("purelib") + "\n")
    (site / "sitecustomize.py").write_text(GUARD)
    return python


@pytest.fixture(scope="module")
def metadata(built: Built) -> Message:
    with zipfile.ZipFile(built.wheel) as wheel:
        [name] = [name for name in wheel.namelist() if name.endswith(".dist-info/METADATA")]
        return Parser().parsestr(wheel.read(name).decode())


def test_an_index_would_take_both(built: Built) -> None:
    _run(sys.executable, "-m", "twine", "check", "--strict", built.sdist, built.wheel, cwd=built.source)


def test_nothing_is_left_in_the_source_folder(built: Built) -> None:
    wheels = built.source.parent / "wheels"
    pip = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index", "--quiet"]
    _run(*pip, "--wheel-dir", wheels, ".", cwd=built.source)
    assert list(wheels.glob("*.whl"))
    assert _files(built.source) == built.before


def test_the_source_distribution_has_every_file(built: Built) -> None:
    with tarfile.open(built.sdist) as archive:
        packed = {name.partition("/")[2] for name in archive.getnames()}
    assert built.before - packed == set()


def test_the_wheel_has_every_file_of_the_packages(built: Built) -> None:
    with zipfile.ZipFile(built.wheel) as archive:
        packed = set(archive.namelist())
    ours = {name for name in built.before if name.split("/")[0] in ("sitl", "sitl_bridge", "controller")}
    assert ours - packed == set()
    assert {name.split("/")[0] for name in packed - ours} == {f"sitl_bridge-{PROJECT['version']}.dist-info"}


def test_links_classifiers_and_extras(metadata: Message) -> None:
    labels = {text.partition(",")[0] for text in metadata.get_all("Project-URL", [])}
    assert {"Homepage", "Documentation", "Changelog", "Issues"} <= labels
    assert len(metadata.get_all("Classifier", [])) > 5
    assert set(metadata.get_all("Provides-Extra", [])) == set(PROJECT["optional-dependencies"])
    assert {"view", "study", "test"} <= set(PROJECT["optional-dependencies"])


def test_pictures_and_pages_of_the_readme_are_found_from_an_index_page(metadata: Message) -> None:
    text = str(metadata.get_payload())
    assert "![" in text
    targets = [part.partition(")")[0] for part in text.split("](")[1:]]
    assert [target for target in targets if not target.startswith(("https://", "#"))] == []


def test_every_copy_of_the_repositorys_address_is_the_same(metadata: Message) -> None:
    """Who puts the true one in must not miss a copy; docs/installing.md names the files."""
    home = PROJECT["urls"]["Homepage"]
    assert all(url.startswith(home) for url in PROJECT["urls"].values())
    assert f"repo_url: {home}\n" in (TOP / "mkdocs.yml").read_text(encoding="utf-8")
    raw = home.replace("github.com", "raw.githubusercontent.com")
    elsewhere = [part.partition(")")[0] for part in str(metadata.get_payload()).split("](http")[1:]]
    assert elsewhere
    assert [url for url in elsewhere if not f"http{url}".startswith((f"{home}/", f"{raw}/"))] == []
    assert f"`{home}`" in (TOP / "docs/installing.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("attempt", "refusal"),
    [
        ("import sys; open(sys.prefix + '/mine', 'w')", "not to be written"),
        ("import socket; socket.create_connection(('192.0.2.1', 9), 1)", "not to be used"),
    ],
)
def test_the_fresh_environment_is_guarded(fresh: Path, attempt: str, refusal: str) -> None:
    done = subprocess.run([fresh, "-c", attempt], capture_output=True, text=True, check=False)
    assert refusal in done.stderr


def test_it_flies_read_only_and_offline(fresh: Path, tmp_path: Path) -> None:
    where = _run(fresh, "-c", "import sitl; print(sitl.__file__)", cwd=tmp_path).stdout.strip()
    assert Path(where).is_relative_to(fresh.parents[1])
    assert PROJECT["version"] in _run(fresh.with_name("sitl"), "--version", cwd=tmp_path).stdout
    flight = ["fly", "setpoint", "--in-process", "--duration", "12", "--out", tmp_path / "out"]
    assert "settled" in _run(fresh.with_name("sitl"), *flight, cwd=tmp_path).stdout
    assert (tmp_path / "out/flight.png").exists()


def test_the_doctor_knows_what_an_installation_requires(fresh: Path, tmp_path: Path) -> None:
    script = "import json; from sitl.doctor.installation import packages, requirements; "
    script += "print(json.dumps([packages(), requirements()]))"
    found, wanted = json.loads(_run(fresh, "-c", script, cwd=tmp_path).stdout)
    assert found[0] == "ok", found
    assert len(wanted.pop("")) == len(PROJECT["dependencies"])
    assert {extra: len(texts) for extra, texts in wanted.items()} == {
        extra: len(texts) for extra, texts in PROJECT["optional-dependencies"].items()
    }


def test_the_fixtures_first_test_passes(fresh: Path, tmp_path: Path) -> None:
    shutil.copy(TOP / "examples/test_with_a_vehicle.py", tmp_path)
    said = _run(fresh, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir=.", ".", cwd=tmp_path)
    assert "1 passed" in said.stdout
