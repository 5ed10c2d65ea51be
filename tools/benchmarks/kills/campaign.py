"""Many kills, one after another, on the same files."""

import multiprocessing
import os
import random
import select
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from rich.table import Table

from observer_rt.foundation.errors import UserError
from observer_rt.service.keeping.keeper import sole_writer
from tools.benchmarks.kills.checks import Kept, Line, Loss, differences, injections_of, loss, read_back
from tools.benchmarks.kills.victim import FILLER, FREE, FULL, FullDisk, Scene, make_scene, run_victim

PATIENCE = 60.0  # s for a daemon to get somewhere


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


def run_campaign(plan: Plan, progress: Callable[[float], None]) -> Iterator[Kill]:
    """Kill daemon after daemon. The folder's files are those of this campaign only."""
    plan.folder.mkdir(parents=True, exist_ok=True)
    scene = make_scene(plan.folder, plan.interface, plan.channel, plan.within)
    for path in plan.folder.glob(f"{scene.state.name}*"), plan.folder.glob(f"{scene.journal.name}*"):
        for left in path:
            left.unlink()
    kept = Kept(0, {})
    strikes = list(Strike)
    for number in range(plan.kills):
        chance = random.Random(f"{plan.seed} {number}")
        kill, after = _kill_one(plan, scene, strikes[number % len(strikes)], chance, kept)
        kept = after or kept
        progress(number + 1.0)
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


def kills_table(kills: Sequence[Kill], plan: Plan) -> Table:
    """A row for each way of being killed."""
    table = Table(
        *("killed", "kills", "injections told", "warnings", "oldest loss: state s", "journal s", "problems"),
        title=f"{len(kills)} kills, saved within {plan.within:g} s, or as long as the disk was full",
    )
    for strike in Strike:
        of_it = [kill for kill in kills if kill.strike is strike]
        if of_it:
            table.add_row(
                strike.value,
                str(len(of_it)),
                str(sum(kill.told for kill in of_it)),
                str(sum(kill.warnings for kill in of_it)),
                f"{max(kill.loss.state for kill in of_it):.3f}",
                f"{max(kill.loss.journal for kill in of_it):.3f}",
                str(sum(len(kill.problems) for kill in of_it)),
            )
    return table


def kills_document(kills: Sequence[Kill], plan: Plan) -> dict[str, Any]:
    """The same for programs, kill by kill."""
    return {
        "within_s": plan.within,
        "seed": plan.seed,
        "interface": plan.interface,
        "kills": [asdict(kill) for kill in kills],
    }
