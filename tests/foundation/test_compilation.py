"""Where compiled code is kept: a folder for every state of a unit, and none for ever."""

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
    """A package of its own that keeps its cache as ours does: units `laws` and, above it, `pump`."""
    folder = tmp_path / "source" / "package"
    for name in ("foundation", "below", "laws", "pump"):
        (folder / name).mkdir(parents=True)
        (folder / name / "__init__.py").write_text("")
    for path in Path(compilation.__file__).parent.glob("*.py"):
        if path.stem in ("compilation", "compiled", "unit_cache"):
            text = path.read_text().replace(" observer_rt.", " package.")
            (folder / "foundation" / path.name).write_text(text)
    entry = "from package.foundation.compilation import use_own_cache\nuse_own_cache()\n"
    (folder / "__init__.py").write_text(entry)
    (folder / "laws" / "flow.py").write_text(
        "from package.foundation import units\nfrom package.foundation.compiled import inner\n"
        "from package.below.limits import (\n    X,\n)\n@inner\ndef flow():\n    return X\n"
    )
    (folder / "laws" / "stiffness.py").write_text("from numba import njit\n")
    (folder / "pump" / "loop.py").write_text(
        "from numba import njit\nfrom package.laws.flow import flow\n"
        "@njit(cache=True)\ndef run():\n    return flow() + 1\n"
    )
    for name in ("foundation/units.py", "below/limits.py", "pump/report.py"):
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


RUN = """
import package.pump.loop
print(package.pump.loop.run(), sum(package.pump.loop.run.stats.cache_hits.values()))
"""


def ran(package: Path, root: Path) -> tuple[int, int]:
    """What the compiled function of a fresh process returns, and how many were found in the cache."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_CACHE")}
    done = subprocess.run(
        [sys.executable, "-c", RUN],
        env={**environment, "NUMBA_CACHE_DIR": str(root), "PYTHONPATH": str(package.parent)},
        capture_output=True,
        text=True,
        check=True,
    )
    result, hits = done.stdout.split()
    return int(result), int(hits)


def units(package: Path, root: Path) -> set[str]:
    """The folders of units."""
    return {path.name for path in cache_folder(package, root).iterdir()}


@pytest.mark.parametrize(
    ("name", "changed"),
    [
        ("laws/stiffness.py", {"laws", "pump"}),  # not imported by the loop: by dispatch it may be called
        ("foundation/units.py", {"laws", "pump"}),
        ("below/limits.py", {"laws", "pump"}),
        ("pump/loop.py", {"pump"}),
        ("pump/report.py", set()),
    ],
)
def test_an_edit_compiles_its_unit_and_those_above(
    package: Path, tmp_path: Path, name: str, changed: set[str]
) -> None:
    root = tmp_path / "cache"
    assert ran(package, root) == (2, 0)
    before = units(package, root)
    with (package / name).open("a") as file:
        file.write("# changed\n")
    assert ran(package, root) == (2, int("pump" not in changed))
    assert {each.rpartition("-")[0] for each in units(package, root) - before} == changed


def test_what_a_compiled_function_returns_follows_what_it_calls(package: Path, tmp_path: Path) -> None:
    root = tmp_path / "cache"
    assert ran(package, root) == (2, 0)
    (package / "below" / "limits.py").write_text("X = 5\n")
    assert ran(package, root) == (6, 0)


@pytest.mark.slow
def test_what_names_types_of_another_version_is_compiled_anew(package: Path, tmp_path: Path) -> None:
    """A function of a unit below is kept for a type of one above: that may have moved since."""
    (package / "laws" / "flow.py").write_text(
        "from package.foundation.compiled import compiled\n@compiled\ndef first(pair):\n    return pair.a\n"
    )
    for module in ("pair", "couple"):
        (package / "pump" / f"{module}.py").write_text(
            "from typing import NamedTuple\nclass Pair(NamedTuple):\n    a: int\n    b: int\n"
        )
        (package / "pump" / "loop.py").write_text(
            f"from package.laws.flow import first as run_first\nfrom package.pump.{module} import Pair\n"
            "def run():\n    return run_first(Pair(3, 4))\nrun.stats = run_first.stats\n"
        )
        assert ran(package, tmp_path / "cache") == (3, 0)
        assert ran(package, tmp_path / "cache") == (3, 1)
        (package / "pump" / f"{module}.py").unlink()


def test_what_was_cut_short_is_compiled_anew(package: Path, tmp_path: Path) -> None:
    assert ran(package, tmp_path / "cache") == (2, 0)
    for suffix in ("nbi", "nbc"):
        assert ran(package, tmp_path / "cache") == (2, 1)
        for path in (tmp_path / "cache").rglob(f"*.{suffix}"):
            path.write_bytes(path.read_bytes()[:-20])
        assert ran(package, tmp_path / "cache") == (2, 0)


def test_what_nobody_used_for_long_is_removed(package: Path, tmp_path: Path) -> None:
    root = tmp_path / "cache"
    ran(package, root)
    own, days = cache_folder(package, root), 24 * 3600
    for name, age in (("old", 20 * days), ("recent", 2 * days)):
        (own / name).mkdir()
        os.utime(own / name, (time.time() - age,) * 2)
    (package / "pump" / "loop.py").open("a").write("# changed\n")
    ran(package, root)
    assert not (own / "old").exists()
    assert (own / "recent").exists()


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
