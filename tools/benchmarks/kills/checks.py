"""What was said before a kill, against what is on disk after it."""

import contextlib
import re
import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from observer_rt.foundation.errors import UserError
from observer_rt.service.keeping.journal import Row, reading_journal
from observer_rt.service.keeping.state_file import load_knowledge, model_hash
from tools.benchmarks.kills.victim import Scene

_INJECTION = re.compile(
    r"injection (?P<number>\d+) at index (?P<index>\d+): (?P<mass>[\d.]+|nan) mg, rail (?P<rail>[\d.]+) MPa, "
    r"v_H (?P<wear>[-+\d.]+), phi (?P<phi>\d+), (?P<verdict>valid|not valid: \w+)"
)


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
        events = restored.knowledge.events if restored.knowledge else 0
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
    def number(name: str, form: str) -> str:
        value = row[name]
        return "nan" if value is None else format(value, form)

    return {
        "number": str(row["number"]),
        "index": str(row["start_index"]),
        "mass": number("mass_mg", ".2f"),
        "rail": number("rail_pressure_MPa", ".1f"),
        "wear": number("nozzle_v_H", "+.3f"),
        "phi": str(row["phi_version"]),
        "verdict": "valid" if row["valid"] else f"not valid: {row['reasons']}",
    }


def loss(before: Kept, after: Kept, told: Sequence[tuple[float, re.Match[str]]], killed: float) -> Loss:
    """Ages of the oldest injections that were told of and are not on disk; one event is learned from each."""
    new = [run for run in after.runs if run not in before.runs]
    rows = len(after.runs[new[0]]) if new else 0

    def age(kept: int) -> float:
        return max(killed - told[kept][0], 0.0) if kept < len(told) else 0.0

    return Loss(age(after.events - before.events), age(rows))
