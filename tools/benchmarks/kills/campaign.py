"""Many kills, one after another, on the same files: what was said before a kill against what is on disk after it."""

import contextlib
import multiprocessing
import os
import random
import re
import select
import sqlite3
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from itertools import cycle
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Annotated, Any

import typer

from observer_rt.daemon.persistence.journal import Row, reading_journal
from observer_rt.daemon.persistence.keeper import sole_writer
from observer_rt.daemon.persistence.state_file import load_knowledge, model_hash
from observer_rt.foundation.errors import UserError
from tools.benchmarks.command_line import JsonOption, SeedOption, app, messages, tracked
from tools.benchmarks.kills.victim import FILLER, FREE, FULL, FullDisk, Scene, make_scene, run_victim
from tools.benchmarks.report import Columns, put_out, table_of

_INJECTION = re.compile(
    r"injection (?P<number>\d+) at index (?P<index>\d+): (?P<mass>[\d.]+ mg|mass unknown), "
    r"rail (?P<rail>[\d.]+) MPa, nozzle flow (?P<flow>[-+\d.]+) %, correction (?P<correction>\d+), "
    r"(?:fuel [-\d.]+ degC, )?(?P<verdict>valid|not valid: \w+)"
)
PATIENCE = 60.0  # s for a daemon to get somewhere


@dataclass(frozen=True)
class Line:
    """What the daemon said, and when, s of the monotonic clock."""

    at: float
    text: str


@dataclass(frozen=True)
class Kept:
    """What is on disk: events learned from (0 without a state), and the journal's rows by run."""

    events: int
    runs: Mapping[int, Sequence[Row]]


@dataclass(frozen=True)
class Loss:
    """How old was the oldest that is not on disk, s before the kill; 0 where nothing is missing."""

    state: float
    journal: float


def injections_of(lines: Sequence[Line]) -> list[tuple[float, re.Match[str]]]:
    """The injections that were told of, with the time."""
    found = ((line.at, _INJECTION.search(line.text)) for line in lines)
    return [(at, match) for at, match in found if match]


def read_back(scene: Scene) -> tuple[Kept | None, list[str]]:
    """What can be read of both files, and what is wrong with them."""
    problems = []
    events, runs = 0, dict[int, list[Row]]()
    try:
        parameters = scene.bench.injector.parameters
        restored = load_knowledge(scene.state, model_hash(parameters), set_aside=False)
        events = restored.knowledge.state.events if restored.knowledge else 0
    except UserError as error:
        problems.append(str(error))
    try:
        if scene.journal.exists():
            runs = _journalled(scene)
    except (UserError, sqlite3.Error) as error:
        problems.append(f"{scene.journal}: {error}")
    return (None if problems else Kept(events, runs)), problems


def _journalled(scene: Scene) -> dict[int, list[Row]]:
    with contextlib.closing(sqlite3.connect(scene.journal)) as connection:
        (verdict,) = connection.execute("PRAGMA integrity_check").fetchone()
        if verdict != "ok":
            raise sqlite3.DatabaseError(verdict)
    with reading_journal(scene.journal) as journal:
        runs: dict[int, list[Row]] = {int(str(run["started_unix_us"])): [] for run in journal.runs()}
        for row in journal.injections():
            runs[int(str(row["run"]))].append(row)
    return runs


def differences(before: Kept, after: Kept, told: Sequence[tuple[float, re.Match[str]]]) -> list[str]:
    """What was changed that is none of this run's, and rows that are not what the daemon said."""
    problems = [
        f"run {run}: rows of an earlier run changed"
        for run, rows in before.runs.items()
        if after.runs.get(run) != rows
    ]
    new = [run for run in after.runs if run not in before.runs]
    if len(new) > 1:
        problems.append(f"{len(new)} runs where there was one")
    rows = after.runs[new[0]] if new else []
    numbers = [row["number"] for row in rows]
    if numbers != list(range(1, len(rows) + 1)):
        problems.append(f"rows missing in the midst: {numbers}")
    for row, (_, said) in zip(rows, told, strict=False):
        if _as_told(row) != said.groupdict():
            problems.append(f"said {said.group()}, wrote {row}")
    return problems


def _as_told(row: Row) -> dict[str, str]:
    mass, flow = row["mass_mg"], row["nozzle_v_H"]
    assert isinstance(flow, float)
    return {
        "number": str(row["number"]),
        "index": str(row["start_index"]),
        "mass": "mass unknown" if mass is None else f"{mass:.2f} mg",
        "rail": format(row["rail_pressure_MPa"], ".1f"),
        "flow": f"{100 * flow:+.1f}",
        "correction": str(row["phi_version"]),
        "verdict": "valid" if row["valid"] else f"not valid: {str(row['reasons']).split(',')[0]}",
    }


def loss(before: Kept, after: Kept, told: Sequence[tuple[float, re.Match[str]]], killed: float) -> Loss:
    """Ages of the oldest injections that were told of and are not on disk; one event is learned from each."""
    new = [run for run in after.runs if run not in before.runs]
    rows = len(after.runs[new[0]]) if new else 0

    def age(kept: int) -> float:
        return max(killed - told[kept][0], 0.0) if kept < len(told) else 0.0

    return Loss(age(after.events - before.events), age(rows))


class Strike(StrEnum):
    """When a daemon is killed."""

    MOMENT = "at any moment"
    SAVE = "while the state is saved"
    JOURNAL = "while the journal is written"
    FULL = "with the disk full before"


@dataclass(frozen=True)
class Plan:
    """A campaign; within: save_within_s [s]; small_disk: the folder is on a disk that may be filled."""

    kills: int
    seed: int
    folder: Path
    within: float
    interface: str
    channel: str
    longest: float = 4.0  # s a daemon lives
    small_disk: bool = False


@dataclass(frozen=True)
class Kill:
    """What became of one daemon; problems: what must not be."""

    strike: Strike
    lived: float  # s
    told: int  # injections
    warnings: int
    loss: Loss
    problems: tuple[str, ...]


def run_campaign(plan: Plan) -> Iterator[Kill]:
    """Kill daemon after daemon. The folder's files are those of this campaign only."""
    plan.folder.mkdir(parents=True, exist_ok=True)
    scene = make_scene(plan.folder, plan.interface, plan.channel, plan.within)
    for file in scene.state, scene.journal:
        for left in plan.folder.glob(f"{file.name}*"):
            left.unlink()
    kept = Kept(0, {})
    for number, strike in tracked(zip(range(plan.kills), cycle(Strike), strict=False), "killing", plan.kills):
        chance = random.Random(f"{plan.seed} {number}")
        kill, after = _kill_one(plan, scene, strike, chance, kept)
        kept = after or kept
        yield kill


class _Ear:
    """Hears what a daemon says through a pipe."""

    def __init__(self, descriptor: int) -> None:
        self.lines: list[Line] = []
        self._descriptor = descriptor
        self._rest = b""

    def listen(self, seconds: float, enough: Callable[[], bool] = lambda: False) -> None:
        """Listen so long, until there is enough, or to the daemon's end; what is cut short is left out."""
        until = time.monotonic() + seconds
        while not enough() and (left := until - time.monotonic()) > 0.0:
            if not select.select([self._descriptor], [], [], left)[0]:
                return
            data = os.read(self._descriptor, 1 << 16)
            if not data:
                return
            *whole, self._rest = (self._rest + data).split(b"\n")
            for line in whole:
                at, _, text = line.decode().partition(" ")
                self.lines.append(Line(float(at), text))


def _kill_one(
    plan: Plan, scene: Scene, strike: Strike, chance: random.Random, before: Kept
) -> tuple[Kill, Kept | None]:
    moment = chance.uniform(0.0, plan.longest)
    full = None
    if strike is Strike.FULL:
        start = chance.uniform(0.2, 0.6) * plan.longest
        full = FullDisk(start, start + chance.uniform(0.25, 2.0) * plan.within, plan.small_disk)
    reading, writing = os.pipe()
    victim = multiprocessing.get_context("fork").Process(
        target=run_victim, args=(scene, writing, full), daemon=True
    )
    began = time.monotonic()
    victim.start()
    os.close(writing)
    ear = _Ear(reading)
    if strike is not Strike.MOMENT:
        ear.listen(PATIENCE, lambda: bool(injections_of(ear.lines)))
    ear.listen(moment)
    lock_problems = _try_lock(scene, victim, ear.lines)
    _await(strike, scene)
    died_before = victim.exitcode
    killed = time.monotonic()
    victim.kill()
    victim.join()
    ear.listen(PATIENCE)
    os.close(reading)
    (plan.folder / FILLER).unlink(missing_ok=True)
    after, problems = read_back(scene)
    lines, told = ear.lines, injections_of(ear.lines)
    lost = Loss(0.0, 0.0)
    if died_before is not None:
        problems.append(f"ended by itself with {died_before}: {[line.text for line in lines[-3:]]}")
    if after is not None:
        problems += differences(before, after, told)
        lost = loss(before, after, told, killed)
        problems += _late(lost, _excused(lines, killed, plan.within), plan.within)
    warnings = sum("warning" in line.text.lower() for line in lines)
    kill = Kill(strike, killed - began, len(told), warnings, lost, (*lock_problems, *problems))
    return kill, after


def _try_lock(scene: Scene, victim: BaseProcess, lines: Sequence[Line]) -> list[str]:
    """A second daemon must be refused with the number of the first, once that has begun."""
    if not any("ready" in line.text for line in lines):
        return []
    try:
        with sole_writer(scene.state):
            return ["a second daemon would have got the state file"]
    except UserError as error:
        return [] if f"process {victim.pid}" in str(error) else [f"the lock names another process: {error}"]


def _await(strike: Strike, scene: Scene) -> None:
    """Wait for the moment that is asked for; once the time is over, any will do."""
    end = time.monotonic() + 2.0
    if strike is Strike.SAVE:
        new = scene.state.with_name(scene.state.name + ".new")
        while not new.exists() and time.monotonic() < end:
            pass
    elif strike is Strike.JOURNAL:
        wal = scene.journal.with_name(scene.journal.name + "-wal")
        before = _changed(wal)
        while _changed(wal) == before and time.monotonic() < end:
            pass


def _changed(path: Path) -> tuple[int, int]:
    try:
        status = path.stat()
    except FileNotFoundError:
        return 0, 0
    return status.st_mtime_ns, status.st_size


def _excused(lines: Sequence[Line], killed: float, within: float) -> float:
    """Seconds before the kill for which a full disk excuses losses."""
    full = next((line.at for line in lines if line.text == FULL), None)
    if full is None:
        return 0.0
    free = next((line.at for line in lines if line.text == FREE), killed)
    return 0.0 if killed - free > within else killed - full


def _late(lost: Loss, excused: float, within: float) -> list[str]:
    allowed = within + excused
    found = {"learned": lost.state, "injected": lost.journal}
    return [
        f"what was {what} {age:.2f} s before the kill is lost, {allowed:.2f} s are allowed"
        for what, age in found.items()
        if age > allowed
    ]


COLUMNS: Columns[Sequence[Kill]] = {
    "kills": lambda of_it: str(len(of_it)),
    "injections told": lambda of_it: str(sum(kill.told for kill in of_it)),
    "warnings": lambda of_it: str(sum(kill.warnings for kill in of_it)),
    "oldest loss: state s": lambda of_it: f"{max(kill.loss.state for kill in of_it):.3f}",
    "journal s": lambda of_it: f"{max(kill.loss.journal for kill in of_it):.3f}",
    "problems": lambda of_it: str(sum(len(kill.problems) for kill in of_it)),
}


def kills_document(kills: Sequence[Kill], plan: Plan) -> dict[str, Any]:
    """The same for programs, kill by kill."""
    return {
        "within_s": plan.within,
        "seed": plan.seed,
        "interface": plan.interface,
        "kills": [asdict(kill) for kill in kills],
    }


@app.command(
    epilog="Example: tools/bench kills --kills 20; tools/vcan tools/bench kills --interface socketcan"
)
def kills(
    kills: Annotated[int, typer.Option(min=1, help="How many daemons are killed.")] = 120,
    seed: SeedOption = 1,
    within: Annotated[float, typer.Option(min=0.1, max=3600, help="save_within_s of the bench file.")] = 1.0,
    interface: Annotated[
        str, typer.Option(help="virtual, or socketcan with a channel that is up.")
    ] = "virtual",
    channel: Annotated[str, typer.Option(help="Channel of the interface.")] = "vcan0",
    small_disk: Annotated[
        bool, typer.Option("--small-disk", help="--out is on a disk of few MB: fill it, instead of a limit.")
    ] = False,
    out: Annotated[Path, typer.Option(help="Folder for the daemons' files, which are removed first.")] = Path(
        "build/kills"
    ),
    as_json: JsonOption = False,
) -> None:
    """Kill daemons that learn at random moments (kill -9): what is lost, and is the rest whole?"""
    plan = Plan(kills, seed, out, within, interface, channel, small_disk=small_disk)
    found = list(run_campaign(plan))
    title = f"{len(found)} kills, saved within {plan.within:g} s, or as long as the disk was full"
    ways = {str(strike): of_it for strike in Strike if (of_it := [k for k in found if k.strike is strike])}
    put_out(as_json, kills_document(found, plan), [table_of(title, "killed", ways, COLUMNS)])
    problems = [problem for kill in found for problem in kill.problems]
    for problem in problems:
        messages.print(problem, highlight=False, markup=False)
    if problems:
        raise typer.Exit(1)
