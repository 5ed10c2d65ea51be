"""What is printed of the results, and the same as data."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.table import Table

from observer_rt.model.effects import VOCABULARY
from tools.benchmarks.discovery import result as results_of
from tools.benchmarks.discovery.hidden import HEALTHY
from tools.benchmarks.discovery.result import CaseResult, Grade, counted_grades
from tools.benchmarks.report import NOTHING, mean, median, percentile, ruled


def effect_table(results: Sequence[CaseResult]) -> Table:
    """Effect by effect: what was found, from what size on, with what interval, and what is left of the gap."""
    table = ruled("hidden effects", ("effect",), (
        *Grade, "found\nfrom", "intervals\nhold %",
        "gap left %\np_L median", "\np90", "\nmass median", "\np90", "seconds\nmax",
    ), no_wrap=True)  # fmt: skip
    for name, cases in results_of.by_effect(results).items():
        table.add_row(
            name, *_grades(cases), printed_size(name, results_of.detection_limit(cases)), *_rest(cases)
        )
    faulty = results_of.faulty(results)
    for title, cases in (
        ("all without rate", [r for r in faulty if not r.with_rate]),
        ("all with rate", [r for r in faulty if r.with_rate]),
        ("all", faulty),
    ):
        if cases:
            table.add_row(title, *_grades(cases), "", *_rest(cases))
    if healthy := results_of.healthy(results):
        seconds = f"{max(r.seconds for r in healthy):.1f}"
        table.add_row(HEALTHY, *_grades(healthy), *[NOTHING] * 6, seconds)
    return table


def confusion_table(results: Sequence[CaseResult]) -> Table:
    """What was answered to each hidden effect, above noise."""
    table = ruled("answers, effects above noise", ("hidden",), ())
    table.add_column("answered")
    for name, cases in (results_of.by_effect(results) | {HEALTHY: results_of.healthy(results)}).items():
        judged = cases if name == HEALTHY else results_of.above_noise(cases)
        counts = Counter(r.answer for r in judged).most_common()
        if counts:
            table.add_row(name, ", ".join(f"{answer} {count}" for answer, count in counts))
    return table


def reliability_table(results: Sequence[CaseResult]) -> Table:
    """Confidence against share of right names."""
    table = ruled("confidence of all names given", (), ("names", "confidence", "right %"))
    for b in results_of.reliability(results):
        table.add_row(str(b.names), f"{b.confidence:.3f}", f"{100.0 * b.right_share:.1f}")
    return table


def misses(results: Sequence[CaseResult]) -> list[str]:
    """A line for every case above noise, or healthy, that was not answered rightly."""
    return [_miss(r) for r in results if not r.right and (r.above_noise or not r.faulty)]


def printed_size(effect: str, size: float | None) -> str:
    """The size of an effect's first parameter in its printed unit."""
    parameters = VOCABULARY[effect].parameters
    if size is None or not parameters:
        return NOTHING
    unit = "" if parameters[0].unit == "-" else f" {parameters[0].unit}"
    return f"{size / parameters[0].si:.2g}{unit}"


def json_document(results: Sequence[CaseResult], crashes: Sequence[str]) -> dict[str, Any]:
    """`figures` with the names all benchmarks share, `details` behind them; null: not measured by this benchmark."""
    above = results_of.above_noise(results)
    shares = results_of.worst_gap_shares(results)
    healthy = results_of.healthy(results)
    covered = results_of.coverage(results)
    twice = results_of.confidences_at_twice_the_limit(results)
    return {
        "figures": {
            "cases": len(results),
            "named_right_share": mean([r.named_right for r in above]),
            "false_alarm_share": 1.0 - results_of.right_share(healthy) if healthy else None,
            "ambiguous_share": results_of.ambiguous_share(above) if above else None,
            "unknown_right_share": None,
            "pairs_right_share": None,
            "tier_b_right_share": None,
            "gap_vs_oracle_median": median(shares),
            "gap_vs_oracle_p90": percentile(shares, 90),
            "confidence_calibration_error": results_of.calibration_error(results),
            "confidence_at_twice_the_limit_median": median(twice),
            "interval_coverage_share": mean(covered),
            "seconds_max": max((r.seconds for r in results), default=None),
        },
        "details": {
            "effects": {name: _details(name, cases) for name, cases in results_of.by_effect(results).items()},
            "grades": counted_grades(r.grade for r in results_of.faulty(results)),
            "healthy": dict(Counter(r.answer for r in healthy)),
            "reliability": [vars(b) for b in results_of.reliability(results)],
            "core_seconds_max": max((r.core_seconds for r in results), default=None),
            "violations": list(results_of.violations(results)),
            "misses": misses(results),
            "crashes": list(crashes),
        },
    }


def _grades(cases: Sequence[CaseResult]) -> list[str]:
    return list(map(str, counted_grades(r.grade for r in cases).values()))


def _rest(cases: Sequence[CaseResult]) -> list[str]:
    covered = results_of.coverage(cases)
    cells = [f"{100.0 * np.mean(covered):.0f}" if covered else NOTHING]
    for signal in ("line_pressure", "injected_mass"):
        shares = results_of.gap_shares(cases, signal)
        cells += [f"{100.0 * np.percentile(shares, p):.1f}" if shares else NOTHING for p in (50, 90)]
    return [*cells, f"{max(r.seconds for r in cases):.1f}"]


def _details(name: str, cases: Sequence[CaseResult]) -> dict[str, Any]:
    return {
        "cases": len(cases),
        "grades": counted_grades(r.grade for r in cases),
        "answers": dict(Counter(r.answer for r in results_of.above_noise(cases))),
        "found_from": printed_size(name, results_of.detection_limit(cases)),
        "intervals_hold": sum(results_of.coverage(cases)),
        "intervals": len(results_of.coverage(cases)),
    }


def _miss(r: CaseResult) -> str:
    hidden = r.effect
    if r.faulty:
        names = [p.name for p in VOCABULARY[r.effect].parameters]
        hidden += "".join(f" {name} {value:.4g}" for name, value in zip(names, r.values, strict=True))
    answer = ", ".join(f"{name} ({confidence:.2f})" for name, confidence in r.claims)
    rivals = "".join(f", {name} {difference:+.0f}" for name, difference in r.rivalry)
    gain = f"; oracle's gain {r.visibility.gain:.0f}{rivals}" if r.visibility else ""
    return f"{r.label}{' with rate' if r.with_rate else ''}: {hidden}: {r.verdict} {answer}{gain}"
