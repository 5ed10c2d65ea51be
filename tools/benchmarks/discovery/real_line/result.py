"""A case on a real line as scored, what the bars make of it, and what many show together."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tools.benchmarks.discovery.hidden import same_effect
from tools.benchmarks.discovery.real_line.cases import Kind
from tools.benchmarks.discovery.real_line.hidden import EFFECTS, Parts
from tools.benchmarks.discovery.result import AMBIGUOUS, NAMED, NONE, UNKNOWN, Grade, Interval

CONFIDENT = 0.9
SURELY_VISIBLE = 3.0  # times the smallest visible size: from there on an effect must be named
PRESSURE_TOLERANCE_MPA, MASS_TOLERANCE_MG, GAP_TOLERANCE = (
    0.003,
    0.02,
    0.02,
)  # by which a gap may grow, or its share
NEAR_TIES = (
    frozenset({"seat_area", "lift_gain", "lift_offset", "lift_dependent_seat_coefficient"}),
    frozenset({"line_pressure_sensor_lag", "channel_skew"}),
    frozenset({"channel_skew", "rail_pressure_skew", "needle_lift_sensor_lag"}),
    frozenset(
        {"rail_pressure_sensor_gain", "rail_pressure_sensor_offset", "line_pressure_sensor_offset"},
    ),
    frozenset({"fuel_density", "orifice_area", "seat_area"}),
)
"""Effects that differ by little at some sizes: an answer that leaves one of a group open may leave all of it open."""
HEALTHY_RIGHT, SINGLES_RIGHT, PAIRS_RIGHT, OUTSIDE_RIGHT = 0.98, 0.92, 0.75, 0.95
COVERAGE, COVERED_CASES = (0.90, 0.98), 20  # from so many intervals on
SECONDS = 30.0  # a case


@dataclass(frozen=True)
class RealGap:
    """Rms of model minus plant on noise-free inputs of unseen recordings; MPa or mg.

    before: of the fitted model; true: with what is hidden in it at its true sizes, the best that naming can do: what
    the fitted model is off by may happen to cancel against an effect.
    """

    before: float
    after: float
    true: float

    def larger(self, tolerance: float) -> bool:
        """Whether the amended model is worse by more than a tolerance in its unit, and by more than its share."""
        least = max(self.before, self.true)
        return self.after > least + max(tolerance, GAP_TOLERANCE * least)


@dataclass(frozen=True)
class RealResult:
    """One case; smallest: what findings.json says could have been seen of each effect's first parameter, SI.

    Gaps are None where no amended model was written.
    """

    label: str
    kind: Kind
    discrepancy: str
    with_rate: bool
    parts: Parts
    verdict: str
    claims: tuple[tuple[str, float], ...]
    listed: tuple[str, ...]
    smallest: tuple[tuple[str, float], ...]
    intervals: tuple[Interval, ...]
    line_pressure: RealGap | None
    injected_mass: RealGap | None
    seconds: float
    core_seconds: float

    @property
    def effects(self) -> tuple[str, ...]:
        """What is hidden."""
        return tuple(name for name, _ in self.parts)

    @property
    def counted(self) -> bool:
        """Whether it must be answered rightly: what is hidden is well above what can be seen."""
        smallest = dict(self.smallest)
        return self.kind in (Kind.HEALTHY, Kind.OUTSIDE) or all(
            abs(values[0]) >= SURELY_VISIBLE * smallest.get(name, 0.0) for name, values in self.parts
        )

    @property
    def named_right(self) -> bool:
        """Whether all effects hidden were named, or members of their exact classes, and nothing else."""
        names = [name for name, _ in self.claims]
        return (
            self.verdict == NAMED
            and len(names) == len(self.parts)
            and all(self._is_hidden(name) for name in names)
            and all(any(same_effect(name, effect) for name in names) for effect in self.effects)
        )

    @property
    def ambiguous_right(self) -> bool:
        """Whether an ambiguous answer lists all that is hidden; of one effect, beside its near ties only."""
        if self.verdict != AMBIGUOUS or not self.parts:
            return False
        lists_all = all(any(same_effect(name, effect) for name in self.listed) for effect in self.effects)
        near = self.kind is not Kind.SINGLE or all(near_tie(name, self.effects[0]) for name in self.listed)
        return lists_all and near

    @property
    def right(self) -> bool:
        """Whether the answer is right, or rightly left open."""
        if self.kind is Kind.HEALTHY:
            return self.verdict == NONE
        if self.kind is Kind.OUTSIDE:
            return self.verdict == UNKNOWN
        return self.named_right or self.ambiguous_right

    @property
    def grade(self) -> Grade:
        """What the answer is worth."""
        if not self.counted:
            return Grade.NOT_LOOKED_FOR
        if self.ambiguous_right:
            return Grade.AMBIGUOUS
        return Grade.RIGHT if self.right else Grade.WRONG

    @property
    def half_right(self) -> bool:
        """Whether one of two effects was named, without or beside another name."""
        named = self.verdict == NAMED and any(self._is_hidden(name) for name, _ in self.claims)
        return self.kind is Kind.PAIR and not self.right and named

    @property
    def wrong_and_sure(self) -> bool:
        """Whether something that is not there was named with confidence."""
        return self.verdict == NAMED and any(
            confidence >= CONFIDENT and not self._is_hidden(name) for name, confidence in self.claims
        )

    @property
    def named_unsure(self) -> bool:
        """Whether something was named, nothing with confidence."""
        return self.verdict == NAMED and all(confidence < CONFIDENT for _, confidence in self.claims)

    @property
    def gap_larger(self) -> bool:
        """Whether the amended model is further from the plant than the fitted one, in either signal."""
        pressure, mass = self.line_pressure, self.injected_mass
        return (pressure is not None and pressure.larger(PRESSURE_TOLERANCE_MPA)) or (
            mass is not None and mass.larger(MASS_TOLERANCE_MG)
        )

    def times_smallest(self, effect: str) -> float:
        """Size of a hidden effect, in multiples of the smallest visible one; inf where none is stated."""
        smallest = dict(self.smallest).get(effect, 0.0)
        size = abs(dict(self.parts)[effect][0])
        return size / smallest if smallest > 0.0 else math.inf

    def _is_hidden(self, name: str) -> bool:
        return any(same_effect(name, effect) for effect in self.effects)


def near_tie(name: str, effect: str) -> bool:
    """Whether an effect may stand beside the true one in an ambiguous answer."""
    return same_effect(name, effect) or any({name, effect} <= group for group in NEAR_TIES)


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
    """Share of answers that are right, or rightly left open; nan without cases."""
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
        (Kind.SINGLE, "singles, right or ambiguous", SINGLES_RIGHT),
        (Kind.PAIR, "pairs, right or ambiguous", PAIRS_RIGHT),
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
