"""A case as scored, what the definitions of the bars make of it, and what many cases show together."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np

from tools.benchmarks.discovery.hidden import HEALTHY, HIDDEN, same_effect
from tools.benchmarks.report import clopper_pearson

VISIBLE_GAIN = 50.0  # of the oracle's -2 log L
RELEVANT_MASS_MG, RELEVANT_PRESSURE_MPA = 0.3, 0.3  # one of them moves by that much
INSEPARABLE = 16.0  # difference of the oracle's -2 log L below which two effects are not told apart
MEANINGFUL_GAP = 0.1  # MPa or mg: below, a share of the gap says nothing
NONE, NAMED, AMBIGUOUS, UNKNOWN, SEVERAL = "none", "named", "ambiguous", "unknown", "several"
NAMED_RIGHT, FALSE_ALARMS = 0.97, 0.01
COVERAGE, POOLED_COVERAGE, POOLED_CASES = 0.95, (0.92, 0.98), 100
CALIBRATION_ERROR, CONFIDENCE = 0.1, 0.9
GAP_MEDIAN, GAP_P90 = 0.05, 0.15
SECONDS = {False: 15.0, True: 30.0}  # a case, without and with measured rate
BIN_EDGES = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0)
TWICE = (1.5, 3.0)  # of the detection limit: taken as "at twice"


class Grade(StrEnum):
    """What an answer is worth: every case has one."""

    RIGHT = "right"
    AMBIGUOUS = (
        "ambiguous"  # rightly left open: what is hidden is among the names, the others cannot be told from it
    )
    WRONG = "wrong"
    NOT_LOOKED_FOR = "not looked for"  # too small to be asked for: whatever was answered


def counted_grades(grades: Iterable[Grade]) -> dict[str, int]:
    """How many there are of each, those of which there are none included."""
    counts = Counter(grades)
    return {grade.value: counts[grade] for grade in Grade}


def grades_line(what: str, counts: Mapping[str, int]) -> str:
    """The counts as a line."""
    return f"{what}: {', '.join(f'{count} {grade}' for grade, count in counts.items())}"


@dataclass(frozen=True)
class Visibility:
    """How visible what is hidden is on the recordings given, by the oracle.

    gain: what -2 log L falls with the true effect; mass_mg: largest change of an injection; pressure_mpa: largest rms
    change of the line pressure over an open phase.
    """

    gain: float
    mass_mg: float
    pressure_mpa: float
    beyond_dead_zone: bool

    @property
    def above_noise(self) -> bool:
        """Whether it must be named."""
        relevant = self.mass_mg >= RELEVANT_MASS_MG or self.pressure_mpa >= RELEVANT_PRESSURE_MPA
        return self.gain >= VISIBLE_GAIN and self.beyond_dead_zone and relevant


@dataclass(frozen=True)
class Gap:
    """Rms of model minus plant on noise-free inputs, on recordings `discover` never saw; MPa or mg."""

    before: float
    after: float
    oracle: float

    @property
    def share_left(self) -> float | None:
        """What is left of the gap, 0 as good as the oracle, 1 no better than before; None without a gap."""
        if self.before - self.oracle < MEANINGFUL_GAP:
            return None
        return (self.after - self.oracle) / (self.before - self.oracle)


@dataclass(frozen=True)
class Interval:
    """A 95 % interval of a rightly named parameter, SI."""

    name: str
    low: float
    high: float
    true: float

    @property
    def holds(self) -> bool:
        """Whether the true value is in it."""
        return self.low <= self.true <= self.high


@dataclass(frozen=True)
class CaseResult:
    """One case; the oracle's figures are None for a healthy one.

    claims: ids and confidences of findings.json; rivalry: by how much the oracle's -2 log L of each effect an
    ambiguous answer lists differs from that of the true one.
    """

    label: str
    effect: str
    values: tuple[float, ...]
    with_rate: bool
    verdict: str
    claims: tuple[tuple[str, float], ...]
    listed: tuple[str, ...]
    visibility: Visibility | None
    rivalry: tuple[tuple[str, float], ...]
    intervals: tuple[Interval, ...]
    line_pressure: Gap | None
    injected_mass: Gap | None
    seconds: float
    core_seconds: float

    @property
    def faulty(self) -> bool:
        """Whether something was hidden."""
        return self.effect != HEALTHY

    @property
    def above_noise(self) -> bool:
        """Whether what was hidden must be named."""
        return self.visibility is not None and self.visibility.above_noise

    @property
    def size(self) -> float:
        """Magnitude of the hidden effect's first parameter; 1 for a switch."""
        return abs(self.values[0]) if self.values else 1.0

    @property
    def named_right(self) -> bool:
        """Whether the one name given is the right one, or a member of its exact class."""
        return self.verdict == NAMED and len(self.claims) == 1 and same_effect(self.claims[0][0], self.effect)

    @property
    def ambiguous_right(self) -> bool:
        """Whether the ambiguity is real: it holds the right name, and the oracle cannot tell the others from it."""
        return (
            self.verdict == AMBIGUOUS
            and any(same_effect(listed, self.effect) for listed in self.listed)
            and all(abs(difference) < INSEPARABLE for _, difference in self.rivalry)
        )

    @property
    def right(self) -> bool:
        """Whether the answer is right, or rightly left open."""
        return self.named_right or self.ambiguous_right if self.faulty else self.verdict == NONE

    @property
    def grade(self) -> Grade:
        """What the answer is worth."""
        if self.faulty and not self.above_noise:
            return Grade.NOT_LOOKED_FOR
        if self.faulty and self.ambiguous_right:
            return Grade.AMBIGUOUS
        return Grade.RIGHT if self.right else Grade.WRONG

    @property
    def answer(self) -> str:
        """The column of the confusion matrix: the one name given, or the verdict."""
        if self.verdict != NAMED:
            return self.verdict
        return self.claims[0][0] if len(self.claims) == 1 else SEVERAL

    @property
    def confidences(self) -> tuple[tuple[float, bool], ...]:
        """Every name given with its confidence, and whether it is what was hidden."""
        return tuple((confidence, same_effect(name, self.effect)) for name, confidence in self.claims)


@dataclass(frozen=True)
class ConfidenceBin:
    """Names given with a confidence in one range."""

    names: int
    confidence: float
    right_share: float


def faulty(results: Sequence[CaseResult]) -> list[CaseResult]:
    """Cases with something hidden."""
    return [r for r in results if r.faulty]


def healthy(results: Sequence[CaseResult]) -> list[CaseResult]:
    """Cases with nothing hidden."""
    return [r for r in results if not r.faulty]


def above_noise(results: Sequence[CaseResult]) -> list[CaseResult]:
    """Cases that must be named."""
    return [r for r in results if r.above_noise]


def by_effect(results: Sequence[CaseResult]) -> dict[str, list[CaseResult]]:
    """Faulty cases of every effect that has some, in the order of the vocabulary."""
    return {name: found for name in HIDDEN if (found := [r for r in results if r.effect == name])}


def right_share(results: Sequence[CaseResult]) -> float:
    """Share of answers that are right, or rightly left open; nan without cases."""
    return float(np.mean([r.right for r in results])) if results else math.nan


def ambiguous_share(results: Sequence[CaseResult]) -> float:
    """Share of ambiguous answers; nan without cases."""
    return float(np.mean([r.verdict == AMBIGUOUS for r in results])) if results else math.nan


def detection_limit(results: Sequence[CaseResult]) -> float | None:
    """Size that best parts the cases of one effect into found and not found; None when none is found."""
    ordered = sorted(results, key=lambda r: r.size)
    found = np.array([r.right for r in ordered])
    if not found.any():
        return None
    wrong = [int(np.sum(found[:i]) + np.sum(~found[i:])) for i in range(len(ordered))]
    place = int(np.argmin(wrong))
    if place == 0:
        return ordered[0].size
    return math.sqrt(ordered[place - 1].size * ordered[place].size)


def coverage(results: Sequence[CaseResult]) -> list[bool]:
    """Whether each parameter's interval holds the truth, in rightly named cases above noise."""
    return [interval.holds for r in above_noise(results) for interval in r.intervals]


def reliability(results: Sequence[CaseResult]) -> tuple[ConfidenceBin, ...]:
    """Names given, by confidence; empty bins left out."""
    pairs = [pair for r in results for pair in r.confidences]
    bins = []
    for low, high in pairwise(BIN_EDGES):
        within = [(c, right) for c, right in pairs if low < c <= high or c == low == 0.0]
        if within:
            confidence, right = np.mean(within, axis=0)
            bins.append(ConfidenceBin(len(within), float(confidence), float(right)))
    return tuple(bins)


def calibration_error(results: Sequence[CaseResult]) -> float | None:
    """Mean distance between confidence and share of right names; None when nothing was named."""
    bins = reliability(results)
    if not bins:
        return None
    return float(
        np.average([abs(b.confidence - b.right_share) for b in bins], weights=[b.names for b in bins])
    )


def confidences_at_twice_the_limit(results: Sequence[CaseResult]) -> list[float]:
    """Confidence in the right name, 0 where it was not given, of cases about twice their detection limit.

    Where two effects cannot be told apart, the confidence is not the answer's to raise: these do not count.
    """
    found = []
    for cases in by_effect(results).values():
        limit = detection_limit(cases)
        if limit is None or not cases[0].values:
            continue
        for r in cases:
            if TWICE[0] <= r.size / limit <= TWICE[1] and not r.ambiguous_right:
                found.append(max((c for c, right in r.confidences if right), default=0.0))
    return found


def gap_shares(results: Sequence[CaseResult], signal: str) -> list[float]:
    """Share of the gap that is left, of `line_pressure` or `injected_mass`, where there was one."""
    gaps = [getattr(r, signal) for r in above_noise(results)]
    return [share for gap in gaps if gap is not None and (share := gap.share_left) is not None]


def worst_gap_shares(results: Sequence[CaseResult]) -> list[float]:
    """The larger of a case's two shares."""
    worst = []
    for r in above_noise(results):
        shares = [s for g in (r.line_pressure, r.injected_mass) if g and (s := g.share_left) is not None]
        if shares:
            worst.append(max(shares))
    return worst


def violations(results: Sequence[CaseResult]) -> Iterator[str]:
    """A line for every bar that is missed."""
    if (cases := above_noise(results)) and right_share(cases) < NAMED_RIGHT:
        yield f"right or rightly ambiguous: {right_share(cases):.1%} < {NAMED_RIGHT:.0%}"
    if (cases := healthy(results)) and 1.0 - right_share(cases) > FALSE_ALARMS:
        yield f"healthy, named anything: {1.0 - right_share(cases):.1%} > {FALSE_ALARMS:.0%}"
    yield from _coverage_violations(results)
    error = calibration_error(results)
    if error is not None and error > CALIBRATION_ERROR:
        yield f"calibration error of the confidence: {error:.3f} > {CALIBRATION_ERROR:g}"
    twice = confidences_at_twice_the_limit(results)
    if twice and np.median(twice) < CONFIDENCE:
        yield f"median confidence at twice the detection limit: {np.median(twice):.2f} < {CONFIDENCE:g}"
    if shares := worst_gap_shares(results):
        median, p90 = np.median(shares), np.percentile(shares, 90)
        if median > GAP_MEDIAN:
            yield f"gap against the oracle, median: {median:.3f} > {GAP_MEDIAN:g}"
        if p90 > GAP_P90:
            yield f"gap against the oracle, p90: {p90:.3f} > {GAP_P90:g}"
    for with_rate, limit in SECONDS.items():
        slowest = max((r.seconds for r in results if r.with_rate is with_rate), default=0.0)
        if slowest > limit:
            yield f"seconds {'with' if with_rate else 'without'} measured rate: {slowest:.1f} > {limit:g}"


def _coverage_violations(results: Sequence[CaseResult]) -> Iterator[str]:
    for name, cases in by_effect(results).items():
        covered = coverage(cases)
        low, high = clopper_pearson(sum(covered), len(covered)) if covered else (0.0, 1.0)
        if not low <= COVERAGE <= high:
            yield f"{name}: coverage of the 95 % intervals: {np.mean(covered):.1%} of {len(covered)}"
    covered = coverage(results)
    if len(covered) >= POOLED_CASES and not POOLED_COVERAGE[0] <= np.mean(covered) <= POOLED_COVERAGE[1]:
        yield f"coverage of all 95 % intervals: {np.mean(covered):.1%} of {len(covered)}, not 92-98 %"
