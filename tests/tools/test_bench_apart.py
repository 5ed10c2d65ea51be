"""Plants, disturbances and what hides cases know nothing of the package: they run where it cannot be imported."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from observer_rt.files.formats import read_recording
from tools.benchmarks.discovery.cases import FURTHER, GIVEN
from tools.benchmarks.discovery.hidden import HIDDEN
from tools.benchmarks.discovery.outside.cases import Asked
from tools.benchmarks.discovery.outside.kinds import KINDS
from tools.benchmarks.discovery.real_line.cases import Kind
from tools.benchmarks.discovery.real_line.discrepancies import Discrepancy
from tools.benchmarks.discovery.real_line.hidden import EFFECTS

REPOSITORY = Path(__file__).parents[2]
ROOMS = (REPOSITORY / "tools" / "benchmarks", REPOSITORY / "tests" / "plants")
CLAIM = "Imports nothing of `observer_rt`"
MORE = ("cases", "realism.sensors", "realism.channels", "realism.benches")
ALONE = """
import importlib, io, json, sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "observer_rt":
            raise ImportError("observer_rt is blocked")

sys.meta_path.insert(0, Blocked())
modules = [importlib.import_module(name) for name in sys.argv[1].split()]
"""
HIDES = """
hiding, folder = modules[0].HIDING, sys.argv[2]
sys.stdin = io.StringIO(sys.argv[3])
hiding.run(["seal", folder])
label = json.loads(open(folder + "/labels.json").read())[0]
hiding.run(["record", folder, label if isinstance(label, str) else label["label"], folder + "/recordings"])
"""
PLANS: dict[str, tuple[dict[str, Any], tuple[str, ...], int]] = {
    "discovery.cases": (
        {"effects": ["seat_area"], "faulty": 1, "healthy": 0, "rates": [True], "master_seed": 1},
        tuple(HIDDEN),
        len(GIVEN),
    ),
    "discovery.real_line.cases": (
        {
            "numbers": {"healthy": 0, "singles": 0, "pairs": 1, "outside": 0},
            "rates": [True],
            "discrepancies": ["mounting"],
            "master_seed": 1,
        },
        (*EFFECTS, *Kind, *Discrepancy),
        len(GIVEN),
    ),
    "discovery.outside.cases": (
        {"tier": "A", "cases": 0, "rates": [True], "master_seed": 1, "names": ["relief_leakage"]},
        (
            *KINDS,
            *(asked for asked in Asked if asked is not Asked.HEALTHY),
        ),  # each has healthy recordings, too
        len(GIVEN) + 2 * len(FURTHER),
    ),
}


def run_alone(program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a program that must succeed without the package."""
    command = [sys.executable, "-c", ALONE + program, *arguments]
    surroundings = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=REPOSITORY, check=False, timeout=120, env=surroundings
    )
    assert done.returncode == 0, done.stderr
    return done


def test_what_claims_to_know_nothing_of_the_package_does_not() -> None:
    claiming = [
        ".".join(path.relative_to(REPOSITORY).with_suffix("").parts)
        for room in ROOMS
        for path in room.rglob("*.py")
        if CLAIM in " ".join((ast.get_docstring(ast.parse(path.read_text())) or "").split())
    ]
    assert {"tests.plants.plant", "tests.plants.wave", "tools.benchmarks.discovery.oracle"} <= set(claiming)
    run_alone("", " ".join((*claiming, *(f"tools.benchmarks.{name}" for name in MORE))))


@pytest.mark.parametrize("generator", PLANS)
def test_cases_are_hidden_from_who_is_asked(generator: str, tmp_path: Path) -> None:
    plan, hidden, count = PLANS[generator]
    files = run_alone(HIDES, f"tools.benchmarks.{generator}", str(tmp_path), json.dumps(plan)).stdout.split()
    labels = (tmp_path / "labels.json").read_text()
    assert not [word for word in hidden if any(word in told for told in (labels, *files))]
    assert len(files) == count
    read = read_recording(Path(files[0]))
    assert read.injection_rate is not None
    assert np.isfinite(read.line_pressure).all()
