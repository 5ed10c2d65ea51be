"""`observer-rt batch --discover`: what is missing in the model, injector by injector, and one table of it.

discovered/INJECTOR/             report.html, findings.json, amended.toml as `discover` writes them
discovered/INJECTOR/group.json   what the answer belongs to, and the recordings that could not be taken
discovered.parquet               a row an injector, `SCHEMA`, the most affected first
"""

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import pyarrow as pa
from pydantic import BaseModel, ConfigDict, ValidationError
from rich.console import Console
from rich.table import Table
from rich.text import Text

from observer_rt.config.bench import Bench
from observer_rt.config.channels import effects_on_one_raster
from observer_rt.config.own_effects import OwnEffects
from observer_rt.desk.evaluation.logged import open_source
from observer_rt.desk.fleet.batch import Dataset, read_injections, write_table
from observer_rt.desk.fleet.cluster import Broken, Jobs, Work
from observer_rt.desk.fleet.groups import NEEDED, Group, ModelGroup, groups_of, kinds_of
from observer_rt.desk.fleet.job import NO_MEMORY, FailedFile
from observer_rt.desk.second_opinion import second_opinion
from observer_rt.foundation.console import progress_bar, results, say
from observer_rt.foundation.errors import ObserverError, UserError
from observer_rt.foundation.files import file_errors, file_hash, replacing
from observer_rt.identification.discovery.discover import (
    AMENDED,
    REPORT,
    DiscoveryTask,
    answer,
    fits_in,
    make_folder,
    refuse_incomparable,
    write_findings,
)
from observer_rt.identification.discovery.runs import GAPS, DiscoveryRun, Document, size_text
from observer_rt.identification.likelihood.excerpts import MOST_SAMPLES
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.reading import (
    hashes,
    read_measured,
    refuse_rates_missing,
    refuse_sample_rates,
)

SAMPLES = 4 * MOST_SAMPLES
"""Of all recordings of an injector together: a search takes memory and time by samples."""


@dataclass(frozen=True)
class Inquiry:
    """What is the same for all groups.

    folder: where relative paths begin; out: of all answers; healthy: recordings the model is judged against; threads:
    of each search.
    """

    folder: Path
    out: Path
    healthy: tuple[Path, ...]
    effects: OwnEffects
    threads: int


@dataclass(frozen=True)
class Ended:
    """How it ended. left_out: recordings that could not be taken; problem: why there is no answer, else empty."""

    left_out: tuple[FailedFile, ...] = ()
    problem: str = ""


def discovered(inquiry: Inquiry, group: Group) -> Ended:
    """Write the answer on a group into its folder."""
    left_out: list[FailedFile] = []
    problem = ""
    try:
        inquiry.effects.use()
        _look(inquiry, group, left_out)
    except ObserverError as error:
        problem = str(error)
    except MemoryError:
        problem = NO_MEMORY
    return Ended(tuple(left_out), problem)


def _look(inquiry: Inquiry, group: Group, left_out: list[FailedFile]) -> None:
    """left_out: of recordings that cannot be taken. Raises `UserError` where there is no other."""
    begin, quiet = time.monotonic(), Console(quiet=True)
    injector = group.kind.alone.injector
    stated = effects_on_one_raster(injector)
    open_one = partial(open_source, bench=group.kind.alone, from_channels=(), console=quiet)

    def read(paths: Sequence[Path], most: int = MOST_SAMPLES) -> tuple[Measurement, ...]:
        return read_measured(paths, open_one, quiet, min(most, MOST_SAMPLES), stated) if paths else ()

    taken: dict[Path, Measurement] = {}  # what can be judged with the latest one
    for name, sha256 in group.files:
        path = inquiry.folder / name
        try:
            (one,) = read([path], SAMPLES // len(group.files))
            with_first = [each.recording for each in (*list(taken.values())[:1], one)]
            refuse_sample_rates(with_first)
            refuse_rates_missing(with_first)
        except ObserverError as error:
            left_out.append(FailedFile(name, sha256, str(error), group.injector))
        else:
            taken[path] = one
    if not taken:
        raise UserError(
            f"{len(left_out)} recordings", f"none can be taken, the latest because {left_out[0].problem}"
        )
    measured, healthy = tuple(taken.values()), read(inquiry.healthy)
    refuse_sample_rates([one.recording for one in (*measured, *healthy)])
    task = DiscoveryTask(injector.parameters, measured, healthy, hashes(list(taken)))
    refuse_incomparable(task, group.kind.file.name)
    folder = inquiry.out / group.folder
    make_folder(folder)
    ask = partial(second_opinion, signals=injector.config.signals)
    with fits_in(folder, task, stated) as store:
        found = answer(task, store, ask, lambda _: None, AMENDED, inquiry.threads)
    found = replace(found, seconds=time.monotonic() - begin)
    write_findings(folder, task, found, group.kind.file, inquiry.healthy)


FOLDER, TABLE = "discovered", "discovered.parquet"
_GROUP = "group.json"
_FILES = {"report": REPORT, "amended": AMENDED}
_FLOOR = "line_pressure_noise_floor_MPa"
_WORDS = ("verdict", "effects", "sizes", "parameter", "unit", "caveats", "rivals", "proposal")
_NUMBERS = (
    "size",
    "size_low",
    "size_high",
    "confidence",
    *(f"{name}_{when}_{unit}" for name, unit, _ in GAPS for when in ("before", "after")),
    _FLOOR,
)
SCHEMA = pa.schema(
    [
        ("injector", pa.string()),
        ("recordings", pa.int64()),
        ("judged", pa.int64()),
        ("left_out", pa.int64()),
        *((name, pa.string()) for name in _WORDS),
        *((name, pa.float64()) for name in _NUMBERS),
        ("report", pa.string()),
        ("amended", pa.string()),
        ("problem", pa.string()),
    ]
)
"""recordings: there are; judged: of these, the latest; left_out: could not be taken. parameter, size, unit: of the
first effect, `_low`, `_high` its 95 % interval; sizes: of all, in words; proposal: the first, if there is one.
report, amended: files below the folder."""


class _Note(BaseModel):
    """Kept of a group beside its answer; key: of the group; problem: why there is no answer, if there is none."""

    model_config = ConfigDict(frozen=True)
    injector: str
    key: str
    recordings: int
    left_out: tuple[FailedFile, ...] = ()
    problem: str = ""


class Answers:
    """Answers by injector; what is there when the power fails is whole, and is not looked for again."""

    def __init__(self, folder: Path) -> None:
        """folder: of the batch."""
        self._folder = folder
        self.place = folder / FOLDER
        with file_errors(self.place):
            self.place.mkdir(exist_ok=True)

    def left_out(self, group: Group, key: str) -> tuple[FailedFile, ...] | None:
        """The recordings that could not be taken, where the group's answer is there; None: it is not."""
        note = _read(self.place / group.folder)
        if note is None or note.problem or note.key != key:
            return None
        return tuple(replace(one, injector=group.injector) for one in note.left_out)

    def take(self, group: Group, key: str, ended: Ended) -> None:
        """The answer is written, or there is none."""
        note = _Note(
            injector=group.injector,
            key=key,
            recordings=group.recordings,
            left_out=ended.left_out,
            problem=ended.problem,
        )
        place = self.place / group.folder
        with file_errors(place):
            place.mkdir(exist_ok=True)
            with replacing(place / _GROUP) as part:
                text = note.model_dump_json(indent=2, exclude={"left_out": {"__all__": {"injector"}}})
                part.write_text(text, encoding="utf-8")

    def table(self) -> pa.Table:
        """All there are, written as a table: a row an injector, the most affected first."""
        notes = {place: _read(place) for place in sorted(self.place.iterdir())}
        rows = [self._row(place, note) for place, note in notes.items() if note is not None]
        table = pa.Table.from_pylist(sorted(rows, key=_affected, reverse=True), SCHEMA)
        write_table(self._folder / TABLE, table)
        return table

    def _row(self, place: Path, note: _Note) -> dict[str, Any]:
        row: dict[str, Any] = {
            "injector": note.injector,
            "recordings": note.recordings,
            "left_out": len(note.left_out),
        }
        if note.problem:
            return row | {"problem": note.problem}
        try:
            document = DiscoveryRun.read(place).document
        except UserError as error:
            return row | {"problem": str(error)}
        files: dict[str, str | None] = {
            name: str((place / file).relative_to(self._folder)) for name, file in _FILES.items()
        }
        if not (place / AMENDED).exists():
            files["amended"] = None
        return row | said_of(document) | files


def _read(place: Path) -> _Note | None:
    try:
        return _Note.model_validate_json((place / _GROUP).read_bytes())
    except (OSError, ValidationError):
        return None


def said_of(document: Document) -> dict[str, Any]:
    """The findings of a run in one row, by column."""
    named = [(each.id, name, size) for each in document.effects for name, size in each.parameters.items()]
    row: dict[str, Any] = {
        "judged": len(document.recordings),
        "verdict": document.verdict,
        "effects": " + ".join(each.id for each in document.effects),
        "sizes": "; ".join(f"{name} = {size_text(size)}" for _, name, size in named),
        "confidence": document.confidence,
        "caveats": "; ".join(each.words for each in document.caveats),
        "rivals": ", ".join(" + ".join(ids) for ids in document.rivals),
        "proposal": document.proposal,
    }
    if named:
        _, name, size = named[0]
        low, high = size.ci95
        row |= {"parameter": name, "size": size.value, "size_low": low, "size_high": high, "unit": size.unit}
    for signal, unit, _ in GAPS:
        gap = document.gap.get(signal) or {}
        row |= {f"{signal}_{when}_{unit}": gap.get(f"{when}_{unit}") for when in ("before", "after")}
    row[_FLOOR] = (document.gap.get("line_pressure") or {}).get("noise_floor_MPa")
    return row


def _affected(row: dict[str, Any]) -> float:
    """How far the line pressure is from the model beyond its noise [MPa]: whatever is missing shows there."""
    off, floor = row.get("line_pressure_before_MPa"), row.get(_FLOOR)
    if off is None:
        return math.inf if "verdict" in row else -1.0
    return math.sqrt(max(0.0, off**2 - (floor or 0.0) ** 2))


_WAITING = 2  # groups at a worker, so that it need not wait for the next
_HEADINGS = ("injector", "verdict", "what is missing", "line pressure off [MPa]", "recordings", "but")


@dataclass(frozen=True)
class Discovering:
    """What is asked of every injector. healthy: recordings the model is judged against, by path, with SHA-256."""

    kinds: tuple[ModelGroup, ...]
    healthy: Mapping[Path, str]
    effects: OwnEffects

    @classmethod
    def of(
        cls, bench: Bench, pattern: str | None, healthy: Sequence[Path], effects: OwnEffects
    ) -> "Discovering":
        """Raises `UserError` for files with which discovery could not begin."""
        hashes = {}
        for path in healthy:
            with file_errors(path):
                hashes[path.absolute()] = file_hash(path)
        return cls(kinds_of(bench, pattern), hashes, effects)

    def of_groups(self, work: Work, files: Mapping[str, Path], dataset: Dataset) -> "FoundAnswers":
        """Have the workers look for what is missing in every injector. files: those of this run by SHA-256.

        Raises `InterruptionError` when it is interrupted.
        """
        answers, found = Answers(dataset.folder), FoundAnswers(SCHEMA.empty_table())
        groups = groups_of(read_injections(dataset.folder, NEEDED), files, self.kinds)
        keys = {group.injector: group.key(tuple(self.healthy.values())) for group in groups}
        waiting: list[Group] = []
        for group in groups:
            left_out = answers.left_out(group, keys[group.injector])
            if left_out is None:
                waiting.append(group)
            else:
                found.skipped += 1
                dataset.take_failures(left_out)
        with progress_bar(work.console, "looking for what is missing", len(waiting)) as progress:
            for group, ended in _outcomes(work, self, answers.place, waiting):
                answers.take(group, keys[group.injector], ended)
                dataset.take_failures(ended.left_out)
                if ended.problem:
                    said = f"injector {group.injector}: {ended.problem}"
                    dataset.take_failures([FailedFile(None, "", said, group.injector)])
                found.failed += bool(ended.problem)
                found.done += not ended.problem
                progress(found.done + found.failed)
        found.answers = answers.table()
        work.refuse_interrupted(found.done + found.skipped, len(groups), "injectors")
        return found


@dataclass
class FoundAnswers:
    """How many injectors have an answer, from this run or an earlier one, or none; answers: all there are."""

    answers: pa.Table
    done: int = 0
    skipped: int = 0
    failed: int = 0

    def as_json(self) -> dict[str, Any]:
        """For programs."""
        counts = {"done": self.done, "skipped": self.skipped, "failed": self.failed}
        return {**counts, "injectors": self.answers.to_pylist()}

    def show(self, folder: Path) -> None:
        """On the screen; folder: of the batch."""
        text = f"{self.done} injectors"
        if self.skipped:
            text += f"; {self.skipped} were done before"
        if self.failed:
            text += f"; {self.failed} have no answer"
        results().print(answer_table(self.answers))
        say(results(), f"{text}; {folder}/{FOLDER}/INJECTOR/{REPORT}")


def _outcomes(
    work: Work, asked: Discovering, place: Path, groups: Sequence[Group]
) -> Iterator[tuple[Group, Ended]]:
    """What becomes of each group, as it becomes known."""
    jobs: Jobs[Group] = Jobs(work.cluster.client)
    threads = jobs.places // max(1, len(groups)) if work.cluster.local else 1
    inquiry = Inquiry(Path.cwd(), place.absolute(), tuple(asked.healthy), asked.effects, max(1, threads))
    remaining = iter(groups)

    def begin_more() -> None:
        for group in islice(remaining, max(0, _WAITING * jobs.places - len(jobs))):
            jobs.begin(group, discovered, inquiry, group)

    for group, result in jobs.outcomes(work.stop, begin_more):
        yield group, Ended(problem=str(result)) if isinstance(result, Broken) else result


def answer_table(answers: pa.Table) -> Table:
    """A row an injector, in the order of the table (columns of `discovered.SCHEMA`)."""
    table = Table(box=None, padding=(0, 3, 0, 0), pad_edge=False)
    for heading in _HEADINGS:
        table.add_column(Text(heading, style="bold"), overflow="fold")
    for row in answers.to_pylist():
        table.add_row(*map(Text, (row["injector"], *_cells(row))))
    return table


def _cells(row: dict[str, Any]) -> tuple[str, str, str, str, str]:
    if row["verdict"] is None:
        return "-", "-", "-", str(row["recordings"]), row["problem"].splitlines()[0]
    missing = (
        f"{row['effects']}: {row['sizes']}" if row["sizes"] else row["effects"] or row["proposal"] or "-"
    )
    if row["rivals"]:
        missing += f", or {row['rivals']}"
    but = [row["caveats"]] * bool(row["caveats"])
    if row["left_out"]:
        but.append(f"{row['left_out']} recordings left out")
    return (
        f"{row['verdict']} ({row['confidence']:.2f})",
        missing,
        _off(row),
        f"{row['judged']} of {row['recordings']}",
        "; ".join(but) or "-",
    )


def _off(row: dict[str, Any]) -> str:
    before, after = (row[f"line_pressure_{when}_MPa"] for when in ("before", "after"))
    if before is None:
        return "-"
    return f"{before:.2g} -> {after:.2g}" if row["effects"] and after is not None else f"{before:.2g}"
