"""Commands without the libraries of an extra: a message that says which extra to install."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from observer_rt.config.bench import EXAMPLE_BENCH
from observer_rt.foundation.errors import EXTRAS
from tests.desk.cli.conftest import Command
from tests.pages import ROOT

WITHOUT = """
import sys
sys.modules.update(dict.fromkeys(sys.argv[1].split(",")))
from observer_rt.__main__ import main
for line in sys.argv[2:]:
    sys.argv = ["observer-rt", *line.split()]
    try:
        main()
    except SystemExit as end:
        assert not end.code, line
"""


def test_every_library_is_in_its_extra() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    of_desk = [*extras["desk"][1:], *extras["pictures"]]  # its first names the other extra
    required = {line.partition(">")[0]: "desk" for line in of_desk} | {"distributed": "batch"}
    required["tornado"] = "monitor"
    assert {
        library: extra for library, extra in EXTRAS.items() if library != "dask"
    } == required  # of distributed


def test_the_daemons_side_needs_no_extra(tmp_path: Path) -> None:
    shutil.copyfile(EXAMPLE_BENCH, tmp_path / "bench.toml")
    lines = (
        "simulate --injections 4 --output injections.csv",
        "evaluate injections.csv --output trace.csv",
        "check --bench bench.toml",
    )
    words = [sys.executable, "-c", WITHOUT, ",".join(EXTRAS), *lines]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr
    assert "bus database" in done.stdout


@pytest.mark.parametrize(
    ("library", "line"),
    [
        ("matplotlib", "evaluate injections.csv --plot injections.png"),
        ("asammdf", "evaluate injections.mf4"),
        ("jinja2", "discover injections.csv --out found"),
        ("tornado", "monitor --bench bench.toml"),
        ("distributed", "batch injections.csv --out results"),
    ],
)
def test_what_is_not_installed_is_named_with_its_extra(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, library: str, line: str
) -> None:
    (tmp_path / "injections.csv").touch()
    (tmp_path / "injections.mf4").write_bytes(b"MDF     4.10    " + bytes(100))
    shutil.copyfile(EXAMPLE_BENCH, tmp_path / "bench.toml")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.delitem(
        sys.modules, "observer_rt.desk.live_page.server", raising=False
    )  # it is imported anew
    assert f"observer-rt[{EXTRAS[library]}]" in command.refused(*line.split())
