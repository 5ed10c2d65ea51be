"""Programs run where the package cannot be imported."""

import os
import subprocess
import sys
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
BLOCKED = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "observer_rt":
            raise ImportError("observer_rt is blocked")

sys.meta_path.insert(0, Blocked())
"""


def run_alone(program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a program that must succeed without the package."""
    command = [sys.executable, "-c", BLOCKED + program, *arguments]
    surroundings = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=REPOSITORY, check=False, timeout=120, env=surroundings
    )
    assert done.returncode == 0, done.stderr
    return done
