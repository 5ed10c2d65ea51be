"""Daemons that learn and are killed, run out of disk, or lose power: are their files intact afterwards?"""

import contextlib
import re
import resource
import socket
import sqlite3
import threading
import time
from collections.abc import Iterator, Sequence
from enum import StrEnum
from pathlib import Path

import numpy as np

from observer_rt.bus.links.opening import open_link
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.daemon.journal import Row, read_journal
from observer_rt.daemon.state_file import load_knowledge
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.files.replay.framing import Framer, all_samples
from observer_rt.files.replay.player import play
from observer_rt.foundation.errors import RunError, UserError
from tests.meanwhile import meanwhile
from tools.benchmarks import campaign
from tools.benchmarks.faults.disk import Disk, operations
from tools.benchmarks.scoring import worn_injector
from tools.benchmarks.speed.native import library
from tools.benchmarks.speed.observers import RUN, Observer, observer
from tools.benchmarks.speed.traffic import Ids, write_bench

WITHIN, MARGIN = 1.0, 1.0  # s: save_within_s, and what a machine with other work may be late
LIVES = (1.0, 4.0)  # s a daemon learns before anything goes wrong
INJECTIONS = 200  # of the recording, 20 a second
SMALL_FILE = 512  # bytes, less than either file needs
CUTS = 20  # moments of a loss of power
_TOLD = re.compile(r"injection (\d+) at index (\d+): (?:([\d.]+) mg|mass unknown), .*, (valid|not valid)")


class Strike(StrEnum):
    KILLED = "killed"
    FULL_DISK = "disk_full"
    POWER_LOST = "power_lost"


def reported_injections(lines: Sequence[str]) -> list[tuple[str, ...]]:
    """Number, index, mass and verdict of the injections a daemon has reported in its log."""
    return [match.groups(default="") for match in map(_TOLD.search, lines) if match]


def difference(rows: Sequence[Row], reported: Sequence[tuple[str, ...]]) -> list[str]:
    """Differences between the journal and the daemon's log, row by row."""
    numbers = [row["number"] for row in rows]
    problems = [] if numbers == list(range(1, len(rows) + 1)) else [f"rows missing in the midst: {numbers}"]
    for row, said in zip(rows, reported, strict=False):
        mass = "" if row["mass_mg"] is None else f"{row['mass_mg']:.2f}"
        verdict = "valid" if row["valid"] else "not valid"
        if (str(row["number"]), str(row["start_index"]), mass, verdict) != said:
            problems.append(f"said {said}, wrote {row}")
    return problems


def read_back(folder: Path, reported: Sequence[tuple[str, ...]], due: int) -> tuple[int, list[str]]:
    """How many of the first `due` injections are missing in a folder, and the faults of its files."""
    rows: list[Row] = []
    problems, events, journal = [], 0, folder / "injections.sqlite"
    try:
        restored = load_knowledge(folder / "state.json", load_bench().injector.parameters)
        events = restored.knowledge.state.events if restored.knowledge else 0
        if journal.exists():
            with contextlib.closing(sqlite3.connect(journal)) as connection:
                [(sound,)] = connection.execute("PRAGMA integrity_check").fetchall()
            rows = read_journal(journal).injections
            problems += difference(rows, reported) + ([] if sound == "ok" else [f"journal: {sound}"])
    except (UserError, sqlite3.Error) as error:
        if due:  # a journal of which nothing was synced may be no journal yet
            problems.append(str(error))
    return max(due - min(len(rows), events), 0), problems


def strike(how: Strike, folder: Path, seed: int) -> campaign.Row:
    """Let a daemon learn in a new folder, strike, and look at its files. Raises RunError where it does not start.

    said: injections reported; lost: those missing although they were due; problems, what: faults, and their lines.
    """
    folder = folder.resolve()  # as the daemon names its files
    chance, disk = np.random.default_rng([seed, list(Strike).index(how)]), folder / "disk"
    disk.mkdir(parents=True)
    preloaded = {"LD_PRELOAD": library("disk_log", folder), "DISK_LOG": folder / "log", "DISK_FOLDER": disk}
    with _learning(disk, preloaded if how is Strike.POWER_LOST else {}) as daemon:
        time.sleep(chance.uniform(*LIVES))
        if how is Strike.FULL_DISK:
            with _without_room(daemon.process.pid):
                time.sleep(chance.uniform(0.25, 2.0) * WITHIN)
        due = len(reported_injections(daemon.said))
        time.sleep(WITHIN + MARGIN)
        ended = daemon.process.poll()
        daemon.process.kill()
        daemon.process.wait()
    reported = reported_injections(daemon.said)
    problems = [] if ended is None else [f"ended by itself with {ended}: {daemon.said[-3:]}"]
    if how is Strike.POWER_LOST:
        readings = _cut(folder, reported, due, chance)
    else:
        readings = [read_back(disk, reported, due)]
        try:
            with _learning(disk, {}):
                pass  # it starts again
        except RunError as error:
            problems.append(str(error))
    problems += [problem for _, others in readings for problem in others]
    lost = max(lost for lost, _ in readings)
    return {"struck": how, "said": len(reported), "lost": lost, "problems": len(problems), "what": problems}


def _cut(
    folder: Path, reported: Sequence[tuple[str, ...]], due: int, chance: np.random.Generator
) -> list[tuple[int, list[str]]]:
    """Read the files as a loss of power leaves them, at several moments; only the last is after all due writes."""
    done, drive, readings, begun = operations(folder / "log"), Disk(folder / "disk"), [], 0
    moments = [*sorted(chance.integers(1, len(done), CUTS - 1).tolist()), len(done)]
    for number, moment in enumerate(moments):
        for operation in done[begun:moment]:
            drive.do(operation)
        begun, target = moment, folder / f"cut{number}"
        target.mkdir()
        drive.cut(target, chance)
        readings.append(read_back(target, reported, due if moment == len(done) else 0))
    return readings


@contextlib.contextmanager
def _learning(disk: Path, environment: dict[str, Path]) -> Iterator[Observer]:
    """A daemon at one end of a socket pair; frames of a worn injector are sent into the other end."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    changes = ("lockstep = false", "lockstep = true"), ("save_within_s = 5", f"save_within_s = {WITHIN:g}")
    path = write_bench(disk.parent, "descriptor", str(theirs.fileno()), Ids(), *changes)
    schedule = make_schedule([60e6, 120e6], INJECTIONS, 0.05, [1.1e-3])
    recording = worn_injector(schedule, 100e3, wear=0.3, seed=3).recording
    frames = list(Framer(map_bus(load_bench(path))).frames(recording, all_samples(recording)))
    files = ("--state", disk / "state.json", "--journal", disk / "injections.sqlite")

    def send(over: threading.Event) -> None:
        with (
            contextlib.suppress(RunError),  # the daemon is gone
            open_link("descriptor", str(ours.fileno()), True, []) as link,
        ):
            play(frames, link, 1.0, stop=over)

    with ours, theirs, observer([*RUN, path, *files], [theirs.fileno()], environment) as daemon, meanwhile(send):
        yield daemon


@contextlib.contextmanager
def _without_room(process: int) -> Iterator[None]:
    soft, hard = resource.prlimit(process, resource.RLIMIT_FSIZE)
    resource.prlimit(process, resource.RLIMIT_FSIZE, (SMALL_FILE, hard))
    try:
        yield
    finally:
        resource.prlimit(process, resource.RLIMIT_FSIZE, (soft, hard))
