"""`tools/bench power`: what a loss of power at any moment leaves of learned state and journal.

The disk: what was not synced may be there or not, write by write, each torn at any byte; names come in their order.
"""

import json
import os
import sqlite3
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.random import Generator

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.daemon.persistence.journal import JournalWriter
from observer_rt.daemon.persistence.state_file import load_knowledge, model_hash, save_knowledge
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.foundation.errors import RunError
from tools.benchmarks.command_line import JsonOption, SeedOption, app
from tools.benchmarks.report import Columns, list_of, put_out
from tools.benchmarks.scoring import worn_injector
from tools.benchmarks.speed.native import library

STATE, JOURNAL, SAID = "learned.json", "injections.sqlite", "said"
WRITTEN = 12  # injections, and states, of the victim


@dataclass(frozen=True)
class Operation:
    """As `native/disk_log.c` notes it."""

    kind: str
    descriptor: int
    offset: int
    data: bytes
    path: str
    target: str


@dataclass
class _File:
    """Content on disk, and what waits to get there: (offset, data), data None: a new length."""

    content: bytearray = field(default_factory=bytearray)
    waiting: list[tuple[int, bytes | None]] = field(default_factory=list)

    def sync(self) -> None:
        for change in self.waiting:
            _apply(self.content, *change)
        self.waiting.clear()

    def after_cut(self, chance: Generator) -> bytes:
        content = bytearray(self.content)
        for offset, data in self.waiting:
            fate = chance.random()
            if fate < 1 / 3:
                continue
            if data is not None and fate < 2 / 3:
                data = data[: int(chance.integers(len(data) + 1))]
            _apply(content, offset, data)
        return bytes(content)


class Disk:
    """Follows operations; `cut` writes what may be left of them."""

    def __init__(self, folder: Path) -> None:
        """folder: the one the operations are in."""
        self._folder = folder
        self._names: dict[str, _File] = {}
        self._durable: dict[str, _File] = {}
        self._moves: list[tuple[str, str, _File | None]] = []  # names to be set or taken away, in order
        self._open: dict[int, _File | None] = {}  # None: the folder

    def do(self, operation: Operation) -> None:
        """One more operation."""
        kind, fd = operation.kind, operation.descriptor
        if kind in ("open", "create", "trunc"):
            self._begin(operation)
        elif kind == "close":
            self._open.pop(fd, None)
        elif kind == "rename":
            moved = self._names[operation.target] = self._names.pop(operation.path)
            self._moves.append(("rename", f"{operation.path}\n{operation.target}", moved))
        elif kind == "unlink":
            self._names.pop(operation.path, None)
            self._moves.append(("unlink", operation.path, None))
        elif fd in self._open:
            file = self._open[fd]
            if file is None and kind == "sync":
                self._sync_names()
            elif file is not None and kind == "sync":
                file.sync()
            elif file is not None:
                file.waiting.append((operation.offset, operation.data if kind == "write" else None))

    def cut(self, target: Path, chance: Generator) -> None:
        """Write into a folder what a loss of power now may leave."""
        names = dict(self._durable)
        for move in self._moves[: int(chance.integers(len(self._moves) + 1))]:
            _move(names, move)
        for path, file in names.items():
            (target / Path(path).name).write_bytes(file.after_cut(chance))

    def _begin(self, operation: Operation) -> None:
        path = operation.path
        if Path(path) == self._folder:
            self._open[operation.descriptor] = None
            return
        if path not in self._names:
            self._names[path] = _File()
            self._moves.append(("set", path, self._names[path]))
        elif operation.kind == "trunc":
            self._names[path].waiting.append((0, None))
        self._open[operation.descriptor] = self._names[path]

    def _sync_names(self) -> None:
        for move in self._moves:
            _move(self._durable, move)
        self._moves.clear()


def operations(log: Path) -> Sequence[Operation]:
    """Those of a log."""
    found, data, at = [], log.read_bytes(), 0
    while at < len(data):
        end = data.index(b"\n", at)
        kind, descriptor, offset, length, path, target = data[at:end].decode().split("\t")
        at = end + 1 + int(length)
        found.append(Operation(kind, int(descriptor), int(offset), data[end + 1 : at], path, target))
    return found


def _apply(content: bytearray, offset: int, data: bytes | None) -> None:
    end = offset if data is None else offset + len(data)
    content.extend(bytes(max(end - len(content), 0)))
    if data is None:
        del content[offset:]
    else:
        content[offset:end] = data


def _move(names: dict[str, _File], move: tuple[str, str, _File | None]) -> None:
    kind, path, file = move
    if kind == "rename":
        source, path = path.split("\n")
        names.pop(source, None)
    if file is None:
        names.pop(path, None)
    else:
        names[path] = file


@dataclass(frozen=True)
class Cut:
    """A loss of power after so many operations. lost: injections that were said to be on disk."""

    operation: int
    lost: int
    problems: tuple[str, ...]


def recorded(folder: Path) -> Sequence[Operation]:
    """What a victim does to its files, in `folder`/disk. Raises RunError where it fails."""
    disk = folder / "disk"
    disk.mkdir()
    environment = {
        "LD_PRELOAD": str(library("disk_log", folder)),
        "DISK_LOG": str(folder / "log"),
        "DISK_FOLDER": str(disk),
    }
    command = [sys.executable, "-m", "tools.benchmarks.kills.power", str(disk)]
    done = subprocess.run(command, env=os.environ | environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RunError(f"the victim failed:\n{done.stderr}")
    return operations(folder / "log")


def cut(found: Sequence[Operation], cuts: int, seed: int, folder: Path) -> list[Cut]:
    """Power lost at so many moments of `recorded` operations, each on a disk of its own."""
    chance = np.random.default_rng(seed)
    drive, results, done = Disk(folder / "disk"), [], 0
    for number, moment in enumerate(sorted(chance.integers(1, len(found) + 1, cuts).tolist())):
        for operation in found[done:moment]:
            drive.do(operation)
        done = moment
        said = [json.loads(each.data) for each in found[:moment] if each.data.startswith(b'{"injections"')]
        results.append(_after(drive, moment, said[-1] if said else {}, folder / f"cut{number}", chance))
    return results


@app.command(epilog="Examples: tools/bench power; tools/bench power --cuts 1000 --seed 2")
def power(
    cuts: Annotated[int, typer.Option(min=1, help="Losses of power.")] = 300,
    seed: SeedOption = 1,
    as_json: JsonOption = False,
) -> None:
    """Power lost at any moment, unsynced writes gone or torn at any byte: is anything lost or unreadable?"""
    with tempfile.TemporaryDirectory(prefix="power-") as folder:
        found = cut(recorded(Path(folder)), cuts, seed, Path(folder))
    wrong = [each for each in found if each.lost or each.problems]
    lost, problems = sum(each.lost for each in found), sum(bool(each.problems) for each in found)
    title = (
        f"{len(found)} losses of power: {lost} injections lost that were on disk, {problems} with a problem"
    )
    columns: Columns[Cut] = {
        "after operation": "{.operation}",
        "problems": lambda each: "; ".join(each.problems),
        "lost": "{.lost}",
    }
    table = list_of(title, [wrong], columns, names=2)
    figures = {"cuts": len(found), "lost": lost, "problems": problems}
    put_out(as_json, {"figures": figures, "details": [asdict(each) for each in wrong]}, [table])
    if wrong:
        raise typer.Exit(1)


def _after(drive: Disk, moment: int, said: dict[str, int], folder: Path, chance: Generator) -> Cut:
    """What is found when the computer starts again."""
    folder.mkdir()
    drive.cut(folder, chance)
    problems, lost = [], 0
    injector = load_injector()
    restored = load_knowledge(folder / STATE, model_hash(injector))
    events = 0 if restored.knowledge is None else restored.knowledge.state.events
    if events < said.get("states", 0):
        problems.append(f"state of event {said['states']} was saved, found: {restored.message}")
    if (folder / JOURNAL).exists() or said.get("injections"):
        try:
            with sqlite3.connect(folder / JOURNAL) as connection:
                (sound,) = connection.execute("PRAGMA integrity_check").fetchone()
                there = {number for (number,) in connection.execute("SELECT number FROM injection")}
        except sqlite3.DatabaseError as error:
            sound, there = str(error), set()
        if said.get("injections"):
            lost = len(set(range(1, said["injections"] + 1)) - there)
            if sound != "ok":
                problems.append(f"journal: {sound}")
    return Cut(moment, lost, tuple(problems))


def _victim(folder: Path) -> None:
    """Write injection after injection and state after state, and say what is on disk."""
    bench, injector = load_bench(), load_injector()
    schedule = make_schedule([100e6], 4, 0.05, [1.2e-3])
    history = evaluate(bench, [worn_injector(schedule, 100e3, wear=0.0).recording])
    report = history.evaluations[0].reports[-1]
    journal = JournalWriter(folder / JOURNAL, bench, lambda _: None)
    said = os.open(folder / SAID, os.O_WRONLY | os.O_CREAT)
    for number in range(1, WRITTEN + 1):
        journal(replace(report, number=number))
        journal.write()
        os.write(said, json.dumps({"injections": number, "states": number - 1}).encode())
        learned = replace(history.knowledge, state=replace(history.knowledge.state, events=number))
        save_knowledge(folder / STATE, learned, model_hash(injector))
        os.write(said, json.dumps({"injections": number, "states": number}).encode())
    journal.finish()


if __name__ == "__main__":
    _victim(Path(sys.argv[1]))
