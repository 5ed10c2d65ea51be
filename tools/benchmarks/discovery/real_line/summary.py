"""What many cases on real lines show together, and which bars are missed."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from tools.benchmarks.discovery.hidden import same_effect
from tools.benchmarks.discovery.real_line.cases import Kind
from tools.benchmarks.discovery.real_line.hidden import EFFECTS
from tools.benchmarks.discovery.real_line.result import CONFIDENT, RealResult
from tools.benchmarks.discovery.result import NAMED, NONE

HEALTHY_RIGHT, SINGLES_RIGHT, PAIRS_RIGHT, OUTSIDE_RIGHT = 0.98, 0.92, 0.75, 0.95
COVERAGE, COVERED_CASES = (0.90, 0.98), 20  # from so many intervals on
SECONDS = 30.0  # a case


def of_kind(results: Sequence[RealResult], kind: Kind) -> list[RealResult]:
    """Cases of a kind."""
    return [r for r in results if r.kind is kind]


def counted(results: Sequence[RealResult], kind: Kind) -> list[RealResult]:
    """Cases of a kind that the bars are about."""
    return [r for r in of_kind(results, kind) if r.counted]


def by_effect(results: Sequence[RealResult]) -> dict[str, list[RealResult]]:
    """Single cases of every effect that has some, in the order of the vocabulary."""
    singles = of_kind(results, Kind.SINGLE)
    return {name: found for name in EFFECTS if (found := [r for r in singles if name in r.effects])}


def share(cases: Sequence[RealResult]) -> float:
    """Share of right answers; nan without cases."""
    return float(np.mean([r.right for r in cases])) if cases else math.nan


def smallest_visible(results: Sequence[RealResult], effect: str) -> float | None:
    """Median of what the answers state as the smallest visible size of an effect, SI; None where none does."""
    stated = [size for r in results for name, size in r.smallest if name == effect]
    return float(np.median(stated)) if stated else None


def smallest_named(cases: Sequence[RealResult]) -> float | None:
    """Smallest size of an effect that was rightly named in single cases, SI; None where none was."""
    return min((abs(r.parts[0][1][0]) for r in cases if r.named_right), default=None)


def coverage(results: Sequence[RealResult]) -> list[bool]:
    """Whether each parameter's interval holds the truth, in rightly named cases."""
    return [interval.holds for r in results for interval in r.intervals]


def accused(results: Sequence[RealResult]) -> list[RealResult]:
    """Healthy cases in which something was named with confidence."""
    return [r for r in of_kind(results, Kind.HEALTHY) if r.wrong_and_sure]


def named_as_others(cases: Sequence[RealResult]) -> int:
    """How many cases were named with an effect that is not there, however surely."""
    return sum(
        r.verdict == NAMED and any(not any(same_effect(n, e) for e in r.effects) for n, _ in r.claims)
        for r in cases
    )


def violations(results: Sequence[RealResult], exceptions: int) -> Iterator[str]:
    """A line for every bar that is missed."""
    for kind, what, bar in (
        (Kind.HEALTHY, f"healthy, answered {NONE}", HEALTHY_RIGHT),
        (Kind.SINGLE, "singles, right", SINGLES_RIGHT),
        (Kind.PAIR, "pairs, right", PAIRS_RIGHT),
        (Kind.OUTSIDE, "outside the vocabulary, answered unknown", OUTSIDE_RIGHT),
    ):
        if (cases := counted(results, kind)) and share(cases) < bar:
            yield f"{what}: {share(cases):.1%} of {len(cases)} < {bar:.0%}"
    if found := accused(results):
        yield f"healthy, something named with confidence {CONFIDENT:g}: {len(found)}"
    if larger := sum(r.gap_larger for r in results):
        yield f"gap larger after than before: {larger}"
    covered = coverage(results)
    low, high = COVERAGE
    if len(covered) >= COVERED_CASES and not low <= np.mean(covered) <= high:
        yield f"coverage of the 95 % intervals: {np.mean(covered):.1%} of {len(covered)}, not {low:.0%} to {high:.0%}"
    if exceptions:
        yield f"exceptions: {exceptions}"
    slowest = max((r.seconds for r in results), default=0.0)
    if slowest > SECONDS:
        yield f"seconds of a case: {slowest:.1f} > {SECONDS:g}"
