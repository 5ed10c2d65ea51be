"""What is printed of cases on real lines, and the same as data."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.table import Table

from tools.benchmarks.discovery.real_line import result as results_of
from tools.benchmarks.discovery.real_line.cases import Kind, hidden_text
from tools.benchmarks.discovery.real_line.discrepancies import Discrepancy
from tools.benchmarks.discovery.real_line.hidden import EFFECTS
from tools.benchmarks.discovery.real_line.result import RealResult
from tools.benchmarks.discovery.result import Grade, counted_grades, grades_line
from tools.benchmarks.discovery.tables import printed_size
from tools.benchmarks.report import NOTHING, mean, ruled

KINDS = (Kind.HEALTHY, Kind.SINGLE, Kind.PAIR, Kind.OUTSIDE)


def discrepancy_table(results: Sequence[RealResult], adequate: dict[str, bool]) -> Table:
    """Discrepancy by discrepancy: right of counted, by kind; adequate: what `fit` says, by the rig's open name."""
    table = ruled("plants, right or ambiguous of those counted", ("discrepancy",), (
        "fit\nadequate", "healthy", "singles", "pairs", "outside", "wrong\nand sure", "gap\nlarger",
        "seconds\nmedian", "\nmax", "of core\nmax",
    ), no_wrap=True)  # fmt: skip
    for discrepancy in Discrepancy:
        if cases := [r for r in results if r.discrepancy == discrepancy]:
            fits = [good for name, good in adequate.items() if name.startswith(discrepancy)]
            table.add_row(discrepancy, _of(sum(fits), len(fits)), *_row(cases))
    if results:
        table.add_row("all", _of(sum(adequate.values()), len(adequate)), *_row(results))
    return table


def effect_table(results: Sequence[RealResult]) -> Table:
    """Effect by effect, single cases: those counted, and below them what became of smaller ones."""
    table = ruled("single effects", ("effect",), (
        *Grade, "of these\nright", "\nwrong", "smallest visible,\nstated",
        "smallest\nnamed", "intervals\nhold",
    ), no_wrap=True)  # fmt: skip
    for name, cases in results_of.by_effect(results).items():
        smaller = [r for r in cases if not r.counted]
        covered = results_of.coverage(cases)
        table.add_row(
            name,
            *map(str, counted_grades(r.grade for r in cases).values()),
            _of(sum(r.right for r in smaller), len(smaller)),
            _of(results_of.named_as_others(smaller), len(smaller)),
            printed_size(name, results_of.smallest_visible(results, name)),
            printed_size(name, results_of.smallest_named(cases)),
            _of(sum(covered), len(covered)),
        )
    return table


def kind_lines(results: Sequence[RealResult]) -> list[str]:
    """What the tables leave out."""
    pairs, outside = (results_of.of_kind(results, kind) for kind in (Kind.PAIR, Kind.OUTSIDE))
    lines = [grades_line("hidden effects, alone and in pairs", _hidden_grades(results))]
    if pairs:
        lines.append(f"pairs, one of both named: {sum(r.half_right for r in pairs)} of {len(pairs)}")
    if outside:
        answers = ", ".join(
            f"{verdict} {n}" for verdict, n in Counter(r.verdict for r in outside).most_common()
        )
        unsure = sum(r.named_unsure for r in outside)
        lines.append(f"outside the vocabulary: {answers}; named, but not surely: {unsure}")
    return lines


def _hidden_grades(results: Sequence[RealResult]) -> dict[str, int]:
    return counted_grades(r.grade for r in results if r.kind in (Kind.SINGLE, Kind.PAIR))


def misses(results: Sequence[RealResult]) -> list[str]:
    """A line for every case that was answered wrongly or left a larger gap; sizes in SI."""
    return [_miss(r) for r in results if (r.counted and not r.right) or r.wrong_and_sure or r.gap_larger]


def json_document(
    results: Sequence[RealResult], adequate: dict[str, bool], crashes: Sequence[str]
) -> dict[str, Any]:
    """`figures` with names other benchmarks share, `details` behind them; null: no case of it."""
    covered = results_of.coverage(results)
    healthy = results_of.of_kind(results, Kind.HEALTHY)
    judged = {kind: results_of.counted(results, kind) for kind in KINDS}
    right = {kind: mean([r.grade is Grade.RIGHT for r in cases]) for kind, cases in judged.items()}
    return {
        "figures": {
            "cases": len(results),
            "named_right_share": right[Kind.SINGLE],
            "false_alarm_share": 1.0 - results_of.share(healthy) if healthy else None,
            "accused_with_confidence": len(results_of.accused(results)),
            "pairs_right_share": right[Kind.PAIR],
            "pairs_half_right": sum(r.half_right for r in results),
            "unknown_right_share": right[Kind.OUTSIDE],
            "wrong_and_sure": sum(r.wrong_and_sure for r in results),
            "gap_larger": sum(r.gap_larger for r in results),
            "coverage_share": mean(covered),
            "exceptions": len(crashes),
            "seconds_max": max((r.seconds for r in results), default=None),
            "core_seconds_max": max((r.core_seconds for r in results), default=None),
            "smallest_visible": {
                name: None if size is None else printed_size(name, size)
                for name in EFFECTS
                for size in [results_of.smallest_visible(results, name)]
            },
        },
        "details": {
            "fit_adequate": adequate,
            "grades": _hidden_grades(results),
            "counted": {kind: len(cases) for kind, cases in judged.items()},
            "cases": [_case(r) for r in results],
            "violations": list(results_of.violations(results, len(crashes))),
            "misses": misses(results),
            "crashes": list(crashes),
        },
    }


def _row(cases: Sequence[RealResult]) -> list[str]:
    counted = [results_of.counted(cases, kind) for kind in KINDS]
    seconds = [r.seconds for r in cases]
    return [
        *(_of(sum(r.right for r in found), len(found)) for found in counted),
        str(sum(r.wrong_and_sure for r in cases)),
        str(sum(r.gap_larger for r in cases)),
        f"{np.median(seconds):.1f}",
        f"{max(seconds):.1f}",
        f"{max(r.core_seconds for r in cases):.1f}",
    ]


def _of(some: int, count: int) -> str:
    return f"{some}/{count}" if count else NOTHING


def _case(r: RealResult) -> dict[str, Any]:
    """A case as data; its sizes in multiples of the smallest visible one where that is stated."""
    entry = asdict(r) | {"right": r.right, "counted": r.counted, "gap_larger": r.gap_larger}
    del entry["smallest"]
    visible = {name: r.times_smallest(name) for name in r.effects}
    return entry | {"times_smallest": {n: t if np.isfinite(t) else None for n, t in visible.items()}}


def _miss(r: RealResult) -> str:
    answer = ", ".join(f"{name} ({confidence:.2f})" for name, confidence in r.claims)
    times = [f"{r.times_smallest(n):.1f}" for n in r.effects if np.isfinite(r.times_smallest(n))]
    visible = f" ({' and '.join(times)} times the smallest visible)" if times else ""
    marks = [mark for mark, given in (("SURE", r.wrong_and_sure), ("GAP", r.gap_larger)) if given]
    gaps = [
        f"{gap.before:.3f} to {gap.after:.3f} {unit} (with the true sizes {gap.true:.3f})"
        for gap, unit in ((r.line_pressure, "MPa"), (r.injected_mass, "mg"))
        if gap
    ]
    rate = " with rate" if r.with_rate else ""
    return (
        f"{r.label} {r.discrepancy}{rate}: {hidden_text(r.parts)}{visible}: {r.verdict} {answer}"
        f"{'; gap ' + ', '.join(gaps) if gaps else ''}{' ' + ' '.join(marks) if marks else ''}"
    )
