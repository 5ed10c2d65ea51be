"""What tools/test sets up and says: a C compiler where the machine has none; how many tests were skipped."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TESTS = """
import pytest

def test_right():
    pass

@pytest.mark.parametrize("_", range(2))
def test_not_here(_):
    pytest.skip("not here")

def test_wrong():
    assert False

@pytest.fixture
def broken():
    assert False

def test_broken(broken):
    pass
"""


def set_up(folder: Path, *programs: str) -> list[str]:
    """What the environment's Python was asked for where these are the machine's programs, and `cc x.c` follows."""
    machine, environment, log = (folder / name for name in ("machine", "environment", "log"))
    (environment / "bin").mkdir(parents=True)
    machine.mkdir()
    for name in ("bash", "sh", "chmod", "dirname", *programs):
        (machine / name).symlink_to("/bin/true" if name == "cc" else str(shutil.which(name)))
    python = environment / "bin" / "python"
    python.write_text(f'#!/bin/sh\necho "$@" >>{shlex.quote(str(log))}\n')
    python.chmod(0o755)
    log.touch()
    commands = (
        f". {shlex.quote(str(ROOT / 'tools' / 'lib' / 'venv.sh'))}; venv={shlex.quote(str(environment))}\n"
        "PATH=$venv/bin:$PATH; ensure_compiler; hash -r; cc x.c"
    )
    done = subprocess.run(
        [str(machine / "bash"), "-euc", commands], env={"PATH": str(machine)}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return log.read_text().splitlines()


def test_a_machine_without_compiler_and_rights_gets_one_into_the_environment(tmp_path: Path) -> None:
    installed, compiled = set_up(tmp_path)
    assert installed.startswith("-m pip install ")
    assert installed.endswith(" ziglang")
    assert compiled == "-m ziglang cc x.c"


def test_the_compiler_of_the_machine_is_left_alone(tmp_path: Path) -> None:
    assert set_up(tmp_path, "cc") == []


def test_skipped_tests_are_counted(tmp_path: Path) -> None:
    tests, counts = tmp_path / "test_some.py", tmp_path / "counts"
    tests.write_text(TESTS)
    command = [sys.executable, "-m", "pytest", "-p", "tests.conftest", "--rootdir", str(tmp_path), str(tests)]
    others = os.environ | {"OBSERVER_RT_TEST_COUNTS": str(counts)}
    done = subprocess.run(command, cwd=ROOT, env=others, capture_output=True, text=True)
    assert done.returncode == pytest.ExitCode.TESTS_FAILED, done.stdout
    assert counts.read_text() == "1 2 2 0\n"
