"""Runs side by side, for the screen."""

from collections.abc import Iterator, Sequence

from rich.table import Table
from rich.text import Text

from observer_rt.discovery.report.printed_units import shown, significant
from observer_rt.discovery.runs import Change, Document, Run, Size, changes

_GAPS = (
    ("line_pressure", "MPa", "line pressure off, rms"),
    ("injection_rate", "mm3_per_ms", "injection rate off, rms"),
    ("injected_mass", "mg", "injected mass off, rms"),
)
_DIGITS = 12  # of a hash


def run_table(runs: Sequence[Run]) -> Table:
    """A column a run: verdict, reservations, sizes, gaps before and after, what it was made from."""
    table = Table(box=None, padding=(0, 3, 0, 0), pad_edge=False)
    for heading in ("", *(run.name for run in runs)):
        table.add_column(Text(heading), overflow="fold")
    documents = [run.document for run in runs]
    for name, cells in _rows(runs, documents):
        table.add_row(Text(name, style="bold"), *map(Text, cells))
    return table


def change_lines(runs: Sequence[Run]) -> list[str]:
    """What changed from the first run to the last, in words."""
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


def _rows(runs: Sequence[Run], documents: Sequence[Document]) -> Iterator[tuple[str, list[str]]]:
    yield "verdict", [document.verdict for document in documents]
    yield "confidence", [f"{document.confidence:.2f}" for document in documents]
    yield "but", ["; ".join(caveat.words for caveat in document.caveats) or "-" for document in documents]
    if any(document.rivals for document in documents):
        yield "or", [", ".join("+".join(ids) for ids in document.rivals) or "-" for document in documents]
    for key in dict.fromkeys(key for run in runs for key in run.sizes()):
        yield " ".join(key), [size_text(run.sizes().get(key)) for run in runs]
    switches = dict.fromkeys(e.id for document in documents for e in document.effects if not e.parameters)
    for effect in switches:
        yield effect, ["found" if effect in [e.id for e in d.effects] else "-" for d in documents]
    for signal, unit, words in _GAPS:
        cells = [_gap(document, signal, unit) for document in documents]
        if any(cell != "-" for cell in cells):
            yield f"{words} [{unit.replace('_per_', '/')}]", cells
    yield "model", [f"{document.model.file} {document.model.sha256[:_DIGITS]}" for document in documents]
    yield "recordings", ["\n".join(document.recordings) for document in documents]


def size_text(size: Size | None) -> str:
    """A size with its 95 % interval, digits as that deserves; a dash for none."""
    if size is None:
        return "-"
    step = significant(max(size.value - size.ci95[0], size.ci95[1] - size.value))
    low, high = (shown(bound, step) for bound in size.ci95)
    unit = "" if size.unit == "-" else f" {size.unit}"
    return f"{shown(size.value, step)} ({low} to {high}){unit}"


def _gap(document: Document, key: str, unit: str) -> str:
    gap = document.gap.get(key)
    if gap is None or gap.get(f"before_{unit}") is None:
        return "-"
    before, after = gap[f"before_{unit}"], gap.get(f"after_{unit}")
    if not gap.get("measured", True):
        return f"{before:.2g} if the amended model is right" if document.effects else "-"
    return f"{before:.2g} -> {after:.2g}" if document.effects and after is not None else f"{before:.2g}"
