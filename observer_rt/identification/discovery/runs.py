"""Runs of `discover` side by side: verdicts, sizes and gaps, and what changed from the first to the last."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from rich.table import Table
from rich.text import Text

from observer_rt.foundation.console import plain_table
from observer_rt.foundation.documents import Document, DocumentPart, Number
from observer_rt.identification.discovery.findings import FINDINGS, ModelSource
from observer_rt.identification.discovery.numbers import shown, significant
from observer_rt.identification.discovery.search.results import Size, Verdict

SCHEMA = 1
GAPS = (
    ("line_pressure", "MPa", "line pressure off, rms"),
    ("injection_rate", "mm3_per_ms", "injection rate off, rms"),
    ("injected_mass", "mg", "injected mass off, rms"),
)
_DIGITS = 12  # of a hash
_REMEDY = "name a folder that `observer-rt discover --out` of this version wrote"


class _Words(DocumentPart):
    words: str


class _Effect(DocumentPart):
    id: str
    parameters: dict[str, Size]


class _Proposal(DocumentPart):
    sentence: str


class _Unknown(DocumentPart):
    proposals: tuple[_Proposal, ...] = ()


class ComparedFindings(Document):
    """Keys of findings.json that runs are compared by."""

    verdict: Verdict
    confidence: float
    caveats: tuple[_Words, ...]
    effects: tuple[_Effect, ...]
    rivals: tuple[tuple[str, ...], ...]
    unknown: _Unknown | None
    gap: dict[str, dict[str, Number | bool] | None]
    model: ModelSource
    recordings: dict[str, str]

    @property
    def proposal(self) -> str:
        """The first proposal; empty without one."""
        return next((one.sentence for one in self.unknown.proposals), "") if self.unknown else ""


@dataclass(frozen=True)
class DiscoveryRun:
    """An answer, by the name of its folder as the user gave it."""

    name: str
    document: ComparedFindings

    @classmethod
    def read(cls, path: Path) -> Self:
        """The run whose folder, or findings.json, this is. Raises `UserError` for what is none."""
        file = path / FINDINGS if path.is_dir() else path
        return cls(str(path), ComparedFindings.read(file, "findings of a run", _REMEDY))

    def sizes(self) -> dict[tuple[str, str], Size]:
        """Sizes by effect and parameter."""
        effects = self.document.effects
        return {(one.id, name): size for one in effects for name, size in one.parameters.items()}


@dataclass(frozen=True)
class Change:
    """Change of a size from one run to another, with the half width of its 95 % interval."""

    effect: str
    parameter: str
    unit: str
    change: float
    half: float

    @property
    def is_significant(self) -> bool:
        """Whether it is beyond its interval."""
        return abs(self.change) > self.half


def changes(before: DiscoveryRun, after: DiscoveryRun) -> tuple[Change, ...]:
    """Changes of every size that both runs found; none where they began with different models."""
    if before.document.model.sha256 != after.document.model.sha256:
        return ()
    old, new = before.sizes(), after.sizes()
    return tuple(
        Change(
            *key,
            unit=size.unit,
            change=new[key].value - size.value,
            half=math.hypot(_half(size), _half(new[key])),
        )
        for key, size in old.items()
        if key in new and new[key].unit == size.unit
    )


def as_json(runs: Sequence[DiscoveryRun]) -> dict[str, Any]:
    """The comparison as a document: every run, and the changes from the first to the last."""
    return {
        "schema": SCHEMA,
        "runs": [
            {"run": run.name, **run.document.model_dump(mode="json", exclude={"schema_"})} for run in runs
        ],
        "changes": [
            {
                "effect": one.effect,
                "parameter": one.parameter,
                "unit": one.unit,
                "change": one.change,
                "ci95": [one.change - one.half, one.change + one.half],
                "significant": one.is_significant,
            }
            for one in changes(runs[0], runs[-1])
        ],
    }


def _half(size: Size) -> float:
    low, high = size.ci95
    return max(size.value - low, high - size.value)


def run_table(runs: Sequence[DiscoveryRun]) -> Table:
    """A column a run: verdict, reservations, sizes, gaps before and after, what it was made from."""
    rows = [[Text(name, style="bold"), *map(Text, cells)] for name, cells in _rows(runs)]
    return plain_table(("", *(run.name for run in runs)), rows, gap=3)


def change_lines(runs: Sequence[DiscoveryRun]) -> list[str]:
    """Describes the changes from the first run to the last."""
    first, last = runs[0].document.model, runs[-1].document.model
    if first.sha256 != last.sha256:
        return [
            "the runs began with different models: a size is what was missing there; in force already: "
            f"{', '.join(first.in_force) or 'nothing'}, and {', '.join(last.in_force) or 'nothing'}"
        ]
    return [_in_words(change) for change in changes(runs[0], runs[-1])]


def _in_words(one: Change) -> str:
    step = significant(one.half)
    unit = "" if one.unit == "-" else f" {one.unit}"
    verdict = "changed" if one.is_significant else "no change that shows"
    moved = f"{'+' if one.change >= 0.0 else ''}{shown(one.change, step)} ± {shown(one.half, step)}{unit}"
    return f"{one.effect} {one.parameter}: {moved} (95 %), {verdict}"


def _rows(runs: Sequence[DiscoveryRun]) -> Iterator[tuple[str, list[str]]]:
    documents = [run.document for run in runs]
    yield "verdict", [document.verdict for document in documents]
    yield "confidence", [f"{document.confidence:.2f}" for document in documents]
    yield "but", ["; ".join(caveat.words for caveat in document.caveats) or "-" for document in documents]
    if any(document.rivals for document in documents):
        yield "or", [", ".join("+".join(ids) for ids in document.rivals) or "-" for document in documents]
    if any(document.proposal for document in documents):
        yield "proposal", [document.proposal or "-" for document in documents]
    for key in dict.fromkeys(key for run in runs for key in run.sizes()):
        yield " ".join(key), [size_text(run.sizes().get(key)) for run in runs]
    switches = dict.fromkeys(e.id for document in documents for e in document.effects if not e.parameters)
    for effect in switches:
        yield effect, ["found" if effect in [e.id for e in d.effects] else "-" for d in documents]
    for signal, unit, words in GAPS:
        cells = [_gap(document, signal, unit) for document in documents]
        if any(cell != "-" for cell in cells):
            yield f"{words} [{unit.replace('_per_', '/')}]", cells
    yield "model", [f"{document.model.file} {document.model.sha256[:_DIGITS]}" for document in documents]
    yield "recordings", ["\n".join(document.recordings) for document in documents]


def size_text(size: Size | None) -> str:
    """A size with its 95 % interval, digits as that deserves; a dash for none."""
    if size is None:
        return "-"
    value, low, high = size.digits
    return f"{value} ({low} to {high})" + ("" if size.unit == "-" else f" {size.unit}")


def _gap(document: ComparedFindings, key: str, unit: str) -> str:
    gap = document.gap.get(key)
    if gap is None or gap.get(f"before_{unit}") is None:
        return "-"
    before, after = gap[f"before_{unit}"], gap.get(f"after_{unit}")
    if not gap.get("measured", True):
        return f"{before:.2g} if the amended model is right" if document.effects else "-"
    return f"{before:.2g} -> {after:.2g}" if document.effects and after is not None else f"{before:.2g}"
