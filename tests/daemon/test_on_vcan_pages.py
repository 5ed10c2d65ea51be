"""README and docs: every command that needs a bus, as it stands, by the shell; can0 is a virtual interface here."""

import json
import os
import re
import shlex
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from tests import own_injector, several_injectors
from tests.daemon.end_to_end import START_TIMEOUT
from tests.interface import own_interfaces
from tests.pages import PAGES, ROOT, Page, needs_bus

JQ = """import json, re, signal, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)  # which ends those before it in the pipe
keys = re.findall(r"\\.(\\w+)", sys.argv[-1])
for line in sys.stdin:
    print(json.dumps([json.loads(line)[key] for key in keys]), flush=True)
"""


@pytest.fixture
def shell(tmp_path: Path) -> "Shell":
    return Shell(tmp_path)


class Shell:
    """A folder, and a shell in it that knows `observer-rt`, and `jq` as far as the pages use it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        programs = folder / "bin"
        programs.mkdir()
        (programs / "jq.py").write_text(JQ)
        for name, what in (("observer-rt", "-m observer_rt"), ("jq", str(programs / "jq.py"))):
            (programs / name).write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} {what} "$@"\n')
            (programs / name).chmod(0o755)
        path = f"{programs}:{os.environ['PATH']}"
        self._started = 0  # commands
        self._environment = os.environ | {"PATH": path, "PYTHONPATH": str(ROOT), "COLUMNS": "200"}

    def do(self, command: str) -> None:
        shell = ["bash", "-c", command]
        done = subprocess.run(
            shell, cwd=self.folder, env=self._environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{command}\n{done.stderr}"

    @contextmanager
    def going(self, command: str, ready: str) -> Iterator[Path]:
        """A command that runs until Ctrl-C, once it has said that it is ready; gives the file of its stdout."""
        self._started += 1
        out, err = (self.folder / f"{self._started}.{stream}" for stream in ("out", "err"))
        with out.open("w") as stdout, err.open("w") as stderr:
            process = subprocess.Popen(
                ["bash", "-c", f"set -o pipefail; {command}"],
                cwd=self.folder,
                env=self._environment,
                stdout=stdout,
                stderr=stderr,
                start_new_session=True,
            )
        try:
            end = time.monotonic() + START_TIMEOUT
            while ready not in err.read_text():
                assert process.poll() is None, err.read_text()
                assert time.monotonic() < end, err.read_text()
                time.sleep(0.1)
            yield out
            os.killpg(process.pid, signal.SIGINT)
            assert process.wait(START_TIMEOUT) == 0, f"{command}\n{err.read_text()}"
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)


def only(commands: list[str], pattern: str) -> str:
    (command,) = (each for each in commands if re.search(pattern, each))
    return command


@pytest.mark.slow
@pytest.mark.vcan
def test_the_commands_that_need_a_bus(shell: Shell, vcan: str) -> None:
    pages = [page for page in PAGES if page.path not in (own_injector.PAGE.path, several_injectors.PAGE.path)]
    commands = list(dict.fromkeys(c for page in pages for c in page.commands if needs_bus(c)))
    viewed, kept, piped = (only(commands, f" run .*{word}") for word in ("--view", "--journal", "jq"))
    recorded, limited = only(commands, r" record .*bus\.blf$"), only(commands, "record .*--duration")
    played, log_played = only(commands, r"replay worn\.csv .*--speed"), only(commands, r"replay bus\.blf")
    on_several = only(commands, "replay .*lift=vcan1")
    assert {*commands} == {viewed, kept, piped, recorded, limited, played, log_played, on_several}
    shell.do("observer-rt run --print-example-bench > bench.toml")
    shell.do("observer-rt simulate --injections 4 --effect orifice_area:v_H=0.3 --output worn.csv")
    with own_interfaces("can0"):
        _run_and_record(shell, viewed, recorded, played)
        assert (shell.folder / "learned.json").exists()
        with shell.going(kept, "start: ready"):
            shell.do(log_played)
        with shell.going(piped, "start: ready") as out:
            shell.do(played)
        injections = [json.loads(line) for line in out.read_text().splitlines()]
        assert [number for _, number, _, _ in injections] == [1, 2, 3, 4]
    _journal(shell)
    _several_buses(shell, on_several)


@pytest.mark.slow
@pytest.mark.vcan
def test_an_injector_of_ones_own(shell: Shell, vcan: str) -> None:
    own_injector.write_files(shell.folder)
    commands = own_injector.PAGE.commands
    for command in commands:
        if re.match("observer-rt simulate|.*> injector.toml|.*--mass ", command):
            shell.do(command)
    shell.do(own_injector.PRINT_BENCH)
    own_injector.change_bench(shell.folder / "bench.toml")
    run, replay = (command for command in commands if needs_bus(command))
    with shell.going(run, "start: ready") as out:
        shell.do(replay)
    injections = [json.loads(line) for line in out.read_text().splitlines()]
    assert [one["number"] for one in injections] == [1, 2, 3, 4, 5, 6]
    assert injections[-1]["valid"]
    assert injections[-1]["indicators"]["nozzle_v_H"]["value"] == pytest.approx(0.2, abs=0.01)


@pytest.mark.slow
@pytest.mark.vcan
def test_several_injectors(shell: Shell, vcan: str) -> None:
    several_injectors.write_bench(shell.folder)
    for words in several_injectors.make_log():
        shell.do(shlex.join(["observer-rt", *words]))
    several_injectors.merge_logs(shell.folder)
    left, right, record, replay = (interface for interface in several_injectors.PAGE.commands if needs_bus(interface))
    with own_interfaces("can0", "can1", "can2"), shell.going(left, "start: ready"):
        _run_and_record(shell, right, record, replay)
    for name in several_injectors.NAMES:
        assert (shell.folder / f"learned_{name}.json").exists()
        with closing(sqlite3.connect(shell.folder / f"injections_{name}.sqlite")) as journal:
            assert journal.execute("SELECT count(*) FROM injection").fetchall() == [(4,)]
    shell.do("observer-rt evaluate engine.blf --bench engine.toml --injector left")


def _run_and_record(shell: Shell, run: str, record: str, replay: str) -> None:
    with shell.going(run, "start: ready"), shell.going(record, "recording socketcan can0"):
        shell.do(replay)


def _journal(shell: Shell) -> None:
    query = next(c for c in Page("docs/journal.md").commands if c.startswith("sqlite3"))
    with closing(sqlite3.connect(shell.folder / "injections.sqlite")) as journal:
        assert journal.execute(shlex.split(query)[-1]).fetchall()


def _several_buses(shell: Shell, replay: str) -> None:
    for path in (ROOT / "tests" / "bus" / "databases").glob("three_buses*"):
        shutil.copy(path, shell.folder)
    (shell.folder / "three_buses.toml").rename(shell.folder / "bench.toml")
    with own_interfaces(*re.findall(r"vcan[1-9]", replay)):
        shell.do(replay)
