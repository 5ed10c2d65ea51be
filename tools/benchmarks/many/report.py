"""A run of `tools/bench batch` as tables and as a document."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.table import Table

from tools.benchmarks.figure import Figure, figures_table
from tools.benchmarks.many.measure import Many, clock, processor
from tools.benchmarks.many.run import Taken
from tools.benchmarks.speed.evaluated import CAN_LOG, MDF4, PARQUET

_FLOOR = "the compiled core alone, nothing learned"


def print_many(many: Many, console: Console) -> None:
    """Figures beside their bars, then every batch."""
    console.print(figures_table(figures(many), "batch", many.load))
    console.print(_batches_table(many))
    start = many.by_number(clock, many.numbers).start
    told = f"beyond the start of {start:.1f} s; the core alone: {many.core_per_s:.0f} injections a second"
    console.print(told, highlight=False)


def many_document(many: Many) -> dict[str, Any]:
    """`figures` by name, `details` of what was measured."""
    return {
        "figures": {each.name: each.value for each in figures(many)},
        "details": {
            **asdict(many),
            "missed": [each.name for each in figures(many) if each.is_met is False],
        },
    }


def figures(many: Many) -> list[Figure]:
    """All of them."""
    return list(_figures(many))


def _figures(many: Many) -> Iterator[Figure]:
    parquet, mdf4, log = (_of(many, source) for source in (PARQUET, MDF4, CAN_LOG))
    yield Figure("injections_per_s_per_core", many.per_core(parquet), "Parquet, nothing learned")
    yield Figure("injections_per_s_per_core_learning", many.per_core(many.learned), "Parquet")
    floor = max(many.per_core(parquet), many.per_core(mdf4)) / many.core_per_s
    yield Figure("floor_share", floor, f"{_FLOOR}; the better of the next two", at_least=0.5)
    yield Figure("floor_share_parquet", many.per_core(parquet) / many.core_per_s, _FLOOR)
    yield Figure("floor_share_mdf4", many.per_core(mdf4) / many.core_per_s, _FLOOR)
    yield Figure("floor_share_mdf4_can_log", many.per_core(log) / many.core_per_s, _FLOOR)
    yield Figure(
        "efficiency_2_workers",
        many.efficiency,
        "one worker, twice; from file to file, once all work",
        at_least=0.9,
    )
    yield Figure("efficiency_2_workers_with_start", many.efficiency_with_start, "the same, whole command")
    off = "a straight line through all"
    yield Figure("off_linear_files", many.by_number(clock, many.numbers).farthest, off, 0.05)
    yield Figure("off_linear_length", many.by_length(clock).farthest, off, 0.05)
    yield Figure("peak_memory_mib", many.peak_mib, "largest process of all")
    longest, shortest = (many.lengths[place].work.seconds for place in (-1, 0))
    what = f"a file of {longest:g} s beside one of {shortest:g} s"
    yield Figure("memory_growth_share", many.memory_growth, what, 0.05)
    yield Figure("start_s", many.by_number(clock, many.numbers).start, "no files at all, by that line")


def _of(many: Many, source: str) -> Taken:
    return next(each for each in many.sources if each.work.files.source == source)


def _batches_table(many: Many) -> Table:
    columns = ("files", "of", "", "workers", "clock s", "processor s", "MiB", "injections / s / core")
    table = Table(*columns, title="batches", title_justify="left")
    groups: Sequence[Sequence[Taken]] = (
        many.numbers,
        many.two_workers,
        many.lengths,
        (*many.sources[1:], many.learned),
    )
    for group in groups:
        for each in group:
            files, learning = each.work.files, ", learning" if each.work.learning else ""
            what = (str(files.number), f"{each.work.seconds:g} s", files.source + learning)
            times = (f"{clock(each):.1f}", f"{processor(each):.1f}", f"{each.peak_mib:.0f}")
            rate = many.per_core(each)  # of a short file: little beyond a start that is not known so well
            table.add_row(*what, str(each.work.workers), *times, f"{rate:.0f}" if rate > 0.0 else "-")
        table.add_section()
    return table
