"""Ctrl-C at any moment ends a command without a traceback."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

# Python imports a module of this name, if there is one, before anything else.
HOOK = """
import sys
class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == "{module}":
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupting())
"""


@pytest.mark.parametrize(
    "module", ["typer", "observer_rt.config.bench", "numba", "observer_rt.service.rights"]
)
def test_while_modules_are_imported(tmp_path: Path, module: str) -> None:
    (tmp_path / "sitecustomize.py").write_text(HOOK.format(module=module))
    path = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    done = subprocess.run(
        [sys.executable, "-m", "observer_rt", "check"],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")
