"""Commands and the library without the libraries of an extra: a message that says which extra to install."""

import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from functools import cache
from importlib.metadata import distribution, packages_distributions
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from observer_rt.config.bench import EXAMPLE_BENCH
from observer_rt.desk.cli.app import COMMANDS
from observer_rt.foundation.errors import EXTRAS
from tests.pages import ROOT

WITHOUT = """
import sys
_, modules, expected, *lines = sys.argv
sys.modules.update(dict.fromkeys(modules.split(",")))
from observer_rt.__main__ import main
for line in lines:
    sys.argv, code = ["observer-rt", *line.split()], 0
    try:
        main()
    except SystemExit as end:
        code = end.code or 0
    assert str(code) == expected, line
"""
LIBRARY = """
import sys
sys.modules.update(dict.fromkeys(sys.argv[1].split(",")))
import observer_rt as ort
for name in ort.__all__:
    getattr(ort, name)
recording, _ = ort.simulate(injections=2)
result = ort.Injector.load().evaluate(ort.to_frame(recording))
try:
    result.plot()
except ort.UserError as error:
    print(error)
"""
REFUSED = {
    "matplotlib": "evaluate injections.csv --plot injections.png",
    "asammdf": "evaluate injections.mf4",
    "jinja2": "discover injections.csv --out found",
    "tornado": "monitor --bench bench.toml",
    "distributed": "batch injections.csv --out results",
}


@cache
def absent() -> str:
    """Modules that are installed here, but not beside the package alone."""
    needed, left = set[str](), ["observer-rt"]
    while left:
        if (name := canonicalize_name(left.pop())) not in needed:
            needed.add(name)
            stated = map(Requirement, distribution(name).requires or ())
            left += [one.name for one in stated if one.marker is None or one.marker.evaluate({"extra": ""})]
    brought = packages_distributions().items()
    return ",".join(module for module, by in brought if needed.isdisjoint(map(canonicalize_name, by)))


def run_without(folder: Path, code: int, lines: Iterable[str]) -> subprocess.CompletedProcess[str]:
    """Run commands one after another without what extras and tests bring; each must end with a code."""
    shutil.copyfile(EXAMPLE_BENCH, folder / "bench.toml")
    words = [sys.executable, "-c", WITHOUT, absent(), str(code), *lines]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr
    return done


BROUGHT = ("dask", "markupsafe")  # by others of the table


def test_every_library_is_in_its_extra() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    of_desk = [*extras["desk"][1:], *extras["pictures"]]  # its first names the other extra
    required = {line.partition(">")[0]: "desk" for line in of_desk} | {"distributed": "batch"}
    required["tornado"] = "monitor"
    assert {library: extra for library, extra in EXTRAS.items() if library not in BROUGHT} == required


def test_the_daemons_side_needs_no_extra(tmp_path: Path) -> None:
    lines = (
        "simulate --injections 4 --output injections.csv",
        "evaluate injections.csv --output trace.csv",
        "check --bench bench.toml",
        "convert injections.csv copy.csv",
        "effects",
        *(f"{name} --help" for names in COMMANDS.values() for name in names),
    )
    assert "bus database" in run_without(tmp_path, 0, lines).stdout


def test_what_is_not_installed_is_named_with_its_extra(tmp_path: Path) -> None:
    (tmp_path / "injections.csv").touch()
    (tmp_path / "injections.mf4").write_bytes(b"MDF     4.10    " + bytes(100))
    said = run_without(tmp_path, 2, REFUSED.values()).stderr
    assert re.findall(r"observer-rt\[(\w+)\]", said) == [EXTRAS[library] for library in REFUSED]


def test_the_library_needs_no_extra_but_for_figures() -> None:
    words = [sys.executable, "-c", LIBRARY, absent()]
    done = subprocess.run(words, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr
    assert "observer-rt[desk]" in done.stdout
