"""Commands without the libraries of an extra: a message that says which extra to install."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from observer_rt.config.bench import EXAMPLE_BENCH
from observer_rt.foundation.errors import EXTRAS

ROOT = Path(__file__).resolve().parents[2]
WITHOUT = """
import sys
sys.modules.update(dict.fromkeys(sys.argv.pop(1).split(",")))
from observer_rt.__main__ import main
main()
"""


def run_without(modules: str, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """A command where some modules cannot be imported."""
    command = [sys.executable, "-c", WITHOUT, modules, *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=100)


def test_every_library_is_in_its_extra() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    of_desk = [*extras["desk"][1:], *extras["pictures"]]  # its first names the other extra
    required = {line.partition(">")[0]: "desk" for line in of_desk} | {"distributed": "batch"}
    required["tornado"] = "monitor"
    assert {
        library: extra for library, extra in EXTRAS.items() if library != "dask"
    } == required  # of distributed


def test_the_daemons_side_needs_no_extra(tmp_path: Path) -> None:
    everything = ",".join(EXTRAS)
    for words in (
        ("simulate", "--injections", "4", "--output", "injections.csv"),
        ("evaluate", "injections.csv", "--output", "trace.csv"),
    ):
        assert (done := run_without(everything, tmp_path, *words)).returncode == 0, done.stderr
    shutil.copyfile(EXAMPLE_BENCH, tmp_path / "bench.toml")
    assert "bus database" in run_without(everything, tmp_path, "check", "--bench", "bench.toml").stdout


@pytest.mark.parametrize(
    ("library", "words"),
    [
        ("matplotlib", ("evaluate", "injections.csv", "--plot", "injections.png")),
        ("asammdf", ("evaluate", "injections.mf4")),
        ("jinja2", ("discover", "injections.csv", "--out", "found")),
        ("tornado", ("monitor", "--bench", "bench.toml")),
        ("distributed", ("batch", "injections.csv", "--out", "results")),
    ],
)
def test_what_is_not_installed_is_named_with_its_extra(
    tmp_path: Path, library: str, words: tuple[str, ...]
) -> None:
    (tmp_path / "injections.csv").touch()
    (tmp_path / "injections.mf4").write_bytes(b"MDF     4.10    " + bytes(100))
    shutil.copyfile(EXAMPLE_BENCH, tmp_path / "bench.toml")
    done = run_without(library, tmp_path, *words)
    assert done.returncode == 2, done.stderr
    assert f"observer-rt[{EXTRAS[library]}]" in done.stderr
    assert "Traceback" not in done.stderr
