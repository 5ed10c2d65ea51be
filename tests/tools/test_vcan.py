"""tools/vcan as its users see it. These tests run outside it: each starts it anew."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

VCAN = Path(__file__).parents[2] / "tools" / "vcan"
LIMIT_S = 120.0  # of one start, on a slow machine that fetches the package first


def run(*command: str, folder: Path | None = None, **variables: str) -> subprocess.CompletedProcess[str]:
    words, others = [sys.executable, str(VCAN), *command], os.environ | variables
    return subprocess.run(words, capture_output=True, text=True, cwd=folder, env=others, timeout=LIMIT_S)


def leftovers(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def processes_that_mention(word: str) -> list[str]:
    """Command lines of living processes; a process may end while it is looked at."""
    lines = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            line = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            if word in line:
                lines.append(line)
    return lines


def test_output_exit_code_environment_and_folder_pass_through(tmp_path: Path) -> None:
    temporary, work = tmp_path / "temporary", tmp_path / "wörk folder"
    temporary.mkdir()
    work.mkdir()
    (work / "input").write_text("from the host\n")
    script = """
        cat input; echo "$GREETING"; id -u; cat /sys/class/net/vcan0/mtu
        echo made >output; echo bad >&2; exit 42
    """
    done = run("bash", "-c", script, folder=work, GREETING="a  'b' \"c\"\n$d", TMPDIR=str(temporary))
    assert done.stdout == f"from the host\na  'b' \"c\"\n$d\n{os.getuid()}\n72\n"
    assert done.stderr.splitlines()[-1] == "bad"
    assert done.returncode == 42
    assert (work / "output").read_text() == "made\n"
    assert leftovers(temporary) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_reaches_the_command_which_ends_in_its_own_way(number: signal.Signals) -> None:
    name = number.name.removeprefix("SIG")
    script = f"trap 'echo stopped; exit 5' {name}; echo ready; while :; do sleep 0.1; done"
    command = [sys.executable, str(VCAN), "bash", "-c", script]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        process.send_signal(number)
        assert process.stdout.read() == b"stopped\n"
        assert process.wait(LIMIT_S) == 5


def test_nothing_is_left_when_it_is_killed(tmp_path: Path) -> None:
    command = [sys.executable, str(VCAN), "bash", "-c", "echo ready; sleep 1000"]
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        process.kill()
        # Every process of the command holds its output open: the end comes when the last one is gone.
        assert process.stdout.read() == b""
    end = time.monotonic() + 10.0
    while (leftovers(tmp_path) or processes_that_mention(str(tmp_path))) and time.monotonic() < end:
        time.sleep(0.05)
    assert leftovers(tmp_path) == []
    assert processes_that_mention(str(tmp_path)) == []


def test_where_vcan0_is_up_already_the_command_runs_right_there() -> None:
    done = run(sys.executable, str(VCAN), "bash", "-c", "echo inside; exit 3")
    assert done.stdout == "inside\n"
    assert done.returncode == 3
    assert done.stderr.splitlines()[-1] == "vcan: running on the host's vcan0"


def test_a_command_that_hangs_is_killed() -> None:
    start = time.monotonic()
    done = run("sleep", "1000", VCAN_TIMEOUT="5")
    assert done.returncode == 124
    assert "VCAN_TIMEOUT" in done.stderr
    assert time.monotonic() - start < 60.0


def test_a_wrong_command_line_is_the_users_mistake() -> None:
    assert run().returncode == 2
    assert run("true", VCAN_TIMEOUT="soon").returncode == 2
