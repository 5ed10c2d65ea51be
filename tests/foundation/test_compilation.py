"""Where compiled code is kept: a folder for every state of the source, and none for ever."""

import os
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from observer_rt.foundation import compilation

SHOW = """
import os, shutil, tempfile
from collections import namedtuple
if limit := os.environ.get("FREE_BYTES"):
    shutil.disk_usage = lambda folder: namedtuple("Usage", "free")(int(limit))
import package
from package.foundation.compilation import compiled_code
print(os.environ["NUMBA_CACHE_DIR"])
print(compiled_code().folder)
print(compiled_code().trouble)
print(compiled_code().remedy)
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package of its own that keeps its cache as ours does."""
    folder = tmp_path / "source" / "package"
    (folder / "foundation").mkdir(parents=True)
    shutil.copy(Path(compilation.__file__), folder / "foundation" / "compilation.py")
    entry = "from package.foundation.compilation import use_own_cache\nuse_own_cache()\n"
    (folder / "__init__.py").write_text(entry)
    (folder / "below").mkdir()
    (folder / "laws.py").write_text(
        "from numba import njit\nfrom package.foundation import units\n"
        "from package.below.limits import (\n    X,\n)\n"
    )
    for name in ("foundation/units.py", "below/limits.py", "report.py"):
        (folder / name).write_text("X = 1\n")
    return folder


@dataclass(frozen=True)
class Kept:
    """What a fresh process that imports the package says: the folder for Numba, and of compiled code."""

    variable: Path
    folder: str
    trouble: str
    remedy: str


def kept(package: Path, root: Path, **environment: str) -> Kept:
    """Of a process that is to use a folder below `root`."""
    done = subprocess.run(
        [sys.executable, "-c", SHOW],
        env={**os.environ, "NUMBA_CACHE_DIR": str(root), "PYTHONPATH": str(package.parent), **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    variable, folder, trouble, remedy = done.stdout.splitlines()
    return Kept(Path(variable), folder, trouble, remedy)


def cache_folder(package: Path, root: Path) -> Path:
    """The folder where nothing is in the way."""
    found = kept(package, root)
    assert (found.folder, found.trouble, found.remedy) == (str(found.variable), "", "")
    return found.variable


def test_same_source_same_folder(package: Path, tmp_path: Path) -> None:
    root = tmp_path / "cache"
    first = cache_folder(package, root)
    assert first.is_dir()
    assert first.is_relative_to(root)
    assert cache_folder(package, root) == first
    assert cache_folder(package, first) == first  # a process started by one that uses it


@pytest.mark.parametrize(
    ("name", "compiled"),
    [("laws.py", True), ("foundation/units.py", True), ("below/limits.py", True), ("report.py", False)],
)
def test_a_change_of_what_compiled_code_rests_on_is_another_folder(
    package: Path, tmp_path: Path, name: str, compiled: bool
) -> None:
    before = cache_folder(package, tmp_path / "cache")
    with (package / name).open("a") as file:
        file.write("# changed\n")
    assert (cache_folder(package, tmp_path / "cache") != before) is compiled


def test_what_nobody_used_for_long_is_removed(package: Path, tmp_path: Path) -> None:
    root = tmp_path / "cache"
    own = cache_folder(package, root)
    days = 24 * 3600
    for name, age in (("old", 20 * days), ("recent", 2 * days)):
        (own.parent / name).mkdir()
        os.utime(own.parent / name, (time.time() - age,) * 2)
    os.utime(own, (time.time() - 20 * days,) * 2)
    assert cache_folder(package, root) == own
    assert {path.name for path in own.parent.iterdir()} == {own.name, "recent"}


@pytest.fixture
def temporary(tmp_path: Path) -> Path:
    """A folder for temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    return folder


@pytest.fixture
def blocked(tmp_path: Path) -> Path:
    """No folder, and none can be made below it, whoever asks."""
    path = tmp_path / "file"
    path.write_text("")
    return path


def test_folder_that_cannot_be_made_is_replaced_by_a_temporary_one(
    package: Path, temporary: Path, blocked: Path
) -> None:
    found = kept(package, blocked, TMPDIR=str(temporary))
    assert found.variable.is_dir()
    assert found.variable.is_relative_to(temporary)
    assert found.folder == str(found.variable)
    assert f"cannot be kept in {blocked}/observer_rt/compiled (Not a directory)" in found.trouble
    assert str(found.variable.parent) in found.trouble
    assert "NUMBA_CACHE_DIR=" in found.remedy
    assert kept(package, Path("/proc"), TMPDIR=str(temporary)).variable == found.variable


def test_a_disk_that_is_all_but_full_is_not_begun_upon(
    package: Path, tmp_path: Path, temporary: Path
) -> None:
    nearly = {"FREE_BYTES": str(50 << 20), "TMPDIR": str(temporary)}
    full = kept(package, tmp_path / "cache", **nearly)
    assert full.folder == "None"  # no other disk has more
    assert "(50 MB are free there, it takes 200) nor elsewhere" in full.trouble
    folder = cache_folder(package, tmp_path / "cache")
    (folder / "function.nbi").write_bytes(b"")
    found = kept(package, tmp_path / "cache", **nearly)
    assert (found.variable, found.trouble) == (folder, "")  # what is there already needs no more room


def test_another_users_folder_is_not_used(package: Path, temporary: Path, blocked: Path) -> None:
    foreign = temporary / f"observer_rt-{os.getuid()}"
    foreign.mkdir()
    made = kept(package, blocked, TMPDIR=str(temporary))
    assert made.variable.parent == foreign
    if os.getuid() == 0:
        os.chown(foreign, 65534, 65534)
        elsewhere = kept(package, blocked, TMPDIR=str(temporary))
        assert not elsewhere.variable.is_relative_to(temporary)
        shutil.rmtree(elsewhere.variable)


def test_compiled_or_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert not compilation.is_compiled()
    (tmp_path / "module").mkdir()
    (tmp_path / "module" / "function-1.nbi").write_bytes(b"")
    assert compilation.is_compiled()
