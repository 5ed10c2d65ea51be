"""Plants, disturbances and what hides cases know nothing of the package: they run where it cannot be imported."""

import ast
import os
import subprocess
import sys
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
ROOMS = (REPOSITORY / "tools" / "benchmarks", REPOSITORY / "tests" / "plants")
CLAIM = "Imports nothing of `observer_rt`"
ALONE = """
import importlib, sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "observer_rt":
            raise ImportError("observer_rt is blocked")

sys.meta_path.insert(0, Blocked())
modules = [importlib.import_module(name) for name in sys.argv[1:]]
"""


def test_what_claims_to_know_nothing_of_the_package_does_not() -> None:
    claiming = [
        ".".join(path.relative_to(REPOSITORY).with_suffix("").parts)
        for room in ROOMS
        for path in room.rglob("*.py")
        if CLAIM in " ".join((ast.get_docstring(ast.parse(path.read_text())) or "").split())
    ]
    blind = {
        "tests.plants.plant",
        "tests.plants.wave",
        *(f"tools.benchmarks.discovery.{m}" for m in ("oracle", "cases")),
    }
    assert blind <= set(claiming)
    surroundings = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    command = [sys.executable, "-c", ALONE, *claiming, "tools.benchmarks.cases"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=REPOSITORY, check=False, env=surroundings)
    assert done.returncode == 0, done.stderr
