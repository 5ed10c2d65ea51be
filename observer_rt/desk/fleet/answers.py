"""Answers of `batch --discover`: stored by injector, and as a table of rows, the most affected injector first."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

import pyarrow as pa
from pydantic import Field, ValidationError
from rich.table import Table

from observer_rt.desk.fleet.dataset import write_table
from observer_rt.desk.fleet.groups import Group
from observer_rt.desk.fleet.job import FailedFile
from observer_rt.foundation.console import plain_table
from observer_rt.foundation.documents import DocumentPart, Number
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.outputs import write_text
from observer_rt.identification.discovery.discover import AMENDED, REPORT
from observer_rt.identification.discovery.report.document import FindingsDocument
from observer_rt.identification.discovery.runs import DiscoveryRun, size_text

FOLDER, TABLE = "discovered", "discovered.parquet"
_GROUP = "group.json"
_HEADINGS = ("injector", "verdict", "what is missing", "line pressure off [MPa]", "recordings", "but")
_COLUMN_TYPES = {str: pa.string(), int: pa.int64(), float: pa.float64()}


class DiscoveredRow(DocumentPart):
    """Findings of an injector, null where there are none. parameter, size, unit: of the first effect, size_low and
    size_high its 95 % interval; proposal: the first, if there is one; problem: why there is no answer."""

    injector: str
    recordings: int = Field(description="there are")
    judged: int | None = Field(None, description="the latest of the recordings")
    left_out: int = Field(description="recordings that could not be taken")
    verdict: str | None = None
    effects: str | None = None
    sizes: str | None = Field(None, description="of all effects, in words")
    parameter: str | None = None
    unit: str | None = None
    caveats: str | None = None
    rivals: str | None = None
    proposal: str | None = None
    size: Number = None
    size_low: Number = None
    size_high: Number = None
    confidence: Number = None
    line_pressure_before_MPa: Number = None  # noqa: N815 - units as printed
    line_pressure_after_MPa: Number = None  # noqa: N815
    injection_rate_before_mm3_per_ms: Number = None
    injection_rate_after_mm3_per_ms: Number = None
    injected_mass_before_mg: Number = None
    injected_mass_after_mg: Number = None
    line_pressure_noise_floor_MPa: Number = None  # noqa: N815
    report: str | None = Field(None, description="file below the folder")
    amended: str | None = Field(None, description="file below the folder")
    moved: str | None = Field(None, description="what wear did before the recordings judged, in words")
    problem: str | None = None

    @property
    def beyond_noise(self) -> float:
        """Distance of line pressure and model beyond noise [MPa]: whatever is missing shows there."""
        if self.line_pressure_before_MPa is None:
            return -1.0 if self.verdict is None else math.inf
        noise = self.line_pressure_noise_floor_MPa or 0.0
        return math.sqrt(max(0.0, self.line_pressure_before_MPa**2 - noise**2))

    @property
    def cells(self) -> tuple[str, ...]:
        """The row for people, under `_HEADINGS`."""
        if self.verdict is None:
            problem = (self.problem or "").splitlines()[0]
            return self.injector, "-", "-", "-", str(self.recordings), problem
        missing = f"{self.effects}: {self.sizes}" if self.sizes else self.effects or self.proposal or "-"
        before, after = self.line_pressure_before_MPa, self.line_pressure_after_MPa
        off = "-" if before is None else f"{before:.2g}"
        left_out = f"{self.left_out} recordings left out" if self.left_out else ""
        return (
            self.injector,
            f"{self.verdict} ({self.confidence:.2f})",
            f"{missing}, or {self.rivals}" if self.rivals else missing,
            f"{off} -> {after:.2g}" if before is not None and self.effects and after is not None else off,
            f"{self.judged} of {self.recordings}",
            "; ".join(filter(None, (self.moved, self.caveats, left_out))) or "-",
        )


SCHEMA = pa.schema(
    [
        (name, _COLUMN_TYPES[(*get_args(field.annotation), field.annotation)[0]])
        for name, field in DiscoveredRow.model_fields.items()
    ]
)


@dataclass(frozen=True)
class Ended:
    """Outcome of the discovery of an injector.

    left_out: recordings that could not be taken; problem: why there is no answer, else empty.
    """

    left_out: tuple[FailedFile, ...] = ()
    problem: str = ""


class _Note(DocumentPart):
    """Record of a group beside its answer; key: of the group; problem: why there is no answer, if there is none."""

    injector: str
    key: str
    recordings: int
    left_out: tuple[FailedFile, ...] = ()
    moved: str = ""
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
            moved=group.moved,
            problem=ended.problem,
        )
        place = self.place / group.folder
        with file_errors(place):
            place.mkdir(exist_ok=True)
            text = note.model_dump_json(indent=2, exclude={"left_out": {"__all__": {"injector"}}})
            write_text(place / _GROUP, text)

    def table(self) -> tuple[DiscoveredRow, ...]:
        """Writes all there are as a table, and returns its rows."""
        notes = {place: _read(place) for place in sorted(self.place.iterdir())}
        rows = [self._row(place, note) for place, note in notes.items() if note is not None]
        rows.sort(key=lambda row: row.beyond_noise, reverse=True)
        write_table(self._folder / TABLE, pa.Table.from_pylist([row.model_dump() for row in rows], SCHEMA))
        return tuple(rows)

    def _row(self, place: Path, note: _Note) -> DiscoveredRow:
        columns: dict[str, Any] = {}
        problem = note.problem or None
        if problem is None:
            try:
                columns = said_of(DiscoveryRun.read(place).document)
            except UserError as error:
                problem = str(error)
            else:
                within = place.relative_to(self._folder)
                amended = str(within / AMENDED) if (place / AMENDED).exists() else None
                columns |= {"report": str(within / REPORT), "amended": amended}
        return DiscoveredRow(
            injector=note.injector,
            recordings=note.recordings,
            left_out=len(note.left_out),
            moved=note.moved or None,
            problem=problem,
            **columns,
        )


def _read(place: Path) -> _Note | None:
    try:
        return _Note.model_validate_json((place / _GROUP).read_bytes())
    except (OSError, ValidationError):
        return None


def said_of(document: FindingsDocument) -> dict[str, Any]:
    """Findings as columns of `DiscoveredRow`."""
    named = [(name, size) for each in document.effects for name, size in each.parameters.items()]
    columns: dict[str, Any] = {
        "judged": len(document.recordings),
        "verdict": document.verdict.value,
        "effects": " + ".join(each.id for each in document.effects),
        "sizes": "; ".join(f"{name} = {size_text(size)}" for name, size in named),
        "confidence": document.confidence,
        "caveats": "; ".join(each.words for each in document.caveats),
        "rivals": ", ".join(" + ".join(ids) for ids in document.rivals),
        "proposal": document.proposal,
    }
    for name, size in named[:1]:
        low, high = size.ci95
        columns |= {
            "parameter": name,
            "size": size.value,
            "size_low": low,
            "size_high": high,
            "unit": size.unit,
        }
    for signal, gap in document.gap.items():
        columns |= {f"{signal}_{figure}": value for figure, value in (gap or {}).items()}
    return {name: value for name, value in columns.items() if name in DiscoveredRow.model_fields}


def answer_table(rows: Sequence[DiscoveredRow]) -> Table:
    """A row an injector, in their order."""
    return plain_table(_HEADINGS, [row.cells for row in rows], gap=3)
