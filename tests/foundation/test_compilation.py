"""Where compiled code is kept: a folder for every state of the source, and none for ever."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from observer_rt.foundation import compilation

SHOW = "import os, package; print(os.environ['NUMBA_CACHE_DIR'])"


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


def cache_folder(package: Path, root: Path) -> Path:
    """The folder a fresh process that imports the package uses below `root`."""
    done = subprocess.run(
        [sys.executable, "-c", SHOW],
        env={**os.environ, "NUMBA_CACHE_DIR": str(root), "PYTHONPATH": str(package.parent)},
        capture_output=True,
        text=True,
        check=True,
    )
    return Path(done.stdout.strip())


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


def test_folder_that_cannot_be_made_is_replaced_by_a_temporary_one(package: Path, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    folder = cache_folder(package, blocked)
    assert folder.is_dir()
    assert not folder.is_relative_to(tmp_path)
    folder.rmdir()


def test_compiled_or_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert not compilation.is_compiled()
    (tmp_path / "module").mkdir()
    (tmp_path / "module" / "function-1.nbi").write_bytes(b"")
    assert compilation.is_compiled()
