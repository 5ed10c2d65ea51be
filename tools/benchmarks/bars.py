"""The bars of the accuracy figures, of both tiers, and which classes and cases miss them."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.plants.wave import Variant
from tools.benchmarks.cases import CLASSES, Group
from tools.benchmarks.report import clopper_pearson, known
from tools.benchmarks.score import NOMINAL, OBSERVER, UKF, CaseScore, SampleTime

WEAR = ("orifice_area", "seat_area", "orifice_and_seat_area")
WEAR_FROM_THE_START = (*WEAR, "growing_wear", "missing_injections")  # where the first useful phi is asked for
THIRD_EVENT = 2  # from 0: its estimate is the first that must be useful
USEFUL_PCT, USEFUL_SHARE = 1.0, 0.97
RECOVERY_EVENTS = 3
WORSE_PCT = 1.0  # than the nominal model, for at most WORSE_EVENTS
WORSE_EVENTS = 3
WORSE_SHARE = 0.002  # of the cases
SIGNIFICANT_WEAR = 0.1  # |v_H| from which the ratio of x3 counts
X3_P5, WAVE_X3 = 40.0, 10.0
MIXED_CASE_PCT = 1.0
COVERAGE_EVENT = 14  # from 0: one injection a case
RATE_COVERAGE = (0.90, 0.98)  # mean of a class; of tier B all classes together, the lower one
POOLED_COVERAGE, POOLED_CASES = (0.93, 0.97), 300  # judged from so many cases on
WAVE_COVERAGE = (0.90, 0.98)  # of a class
SAMPLE_US = 3.0  # of x~ and x^
WAVE_JUDGED = 2  # events after which a travelling wave must be known as such
VARIANT_PCT = 1.5  # any valid mass on a line the structures do not contain
PERCENT = {"p95": 95, "largest": 100}
LARGEST = "mass error, largest of the valid injections [%]"


@dataclass(frozen=True)
class Bars:
    """Limits of a class: mass error of single valid injections [%], RMSE [mm3/ms]; of any one; valid share.

    None: no limit.
    """

    mass_pct: float
    rmse: float | None
    any_pct: float | None = None
    valid_share: float = 0.98


_MAIN = Bars(0.4, 0.45, 0.6)
_BARS = {
    **{name: _MAIN for name, c in CLASSES.items() if c.group in (Group.MAIN, Group.OPERATION)},
    "chamber_pressure_rise": Bars(0.4, 0.6, 0.6),
    "at_50_khz": Bars(0.7, 0.7),
    "at_20_khz": Bars(1.2, 1.2),
}
"""Of the 95th percentile, on the nominal structure."""
_FAULTY, _HARD = Bars(0.6, 0.6, valid_share=0.95), Bars(1.0, None, valid_share=0.95)
_ESTIMATED = (
    *WEAR,
    "guide_leakage",
    "chamber_pressure_rise",
    "orifice_cavitation",
    "line_pressure_sensor_offset",
)
_WAVE_BARS = {
    "healthy": Bars(0.3, 0.4, valid_share=0.95),
    **dict.fromkeys(_ESTIMATED, _FAULTY),
    **dict.fromkeys(("line_friction", "line_pressure_sensor_lag"), _HARD),
    "wear_averaged_20_khz": Bars(1.0, 1.2, valid_share=0.95),
}
"""Of every case, on tier B's plain line."""


def by_class(scores: Sequence[CaseScore]) -> dict[str, list[CaseScore]]:
    """Scores of every class that has some, in the order of `CLASSES`."""
    return {name: found for name in CLASSES if (found := [s for s in scores if s.class_name == name])}


def mass_errors_pct(scores: Iterable[CaseScore], name: str = OBSERVER) -> list[float]:
    """Absolute mass errors of the single injections that are scored, of all cases together."""
    return [error for s in scores for error in np.abs(s.errors_pct(name)).tolist()]


def useful_at_third(score: CaseScore) -> bool:
    """Whether the third event's mass is within 1 %."""
    return bool(abs(score.event_errors_pct()[THIRD_EVENT]) < USEFUL_PCT)


def recovered(score: CaseScore) -> bool:
    """Whether the mass is within 1 % again three events after the change."""
    assert score.change_event is not None
    return bool(abs(score.event_errors_pct()[score.change_event + RECOVERY_EVENTS]) < USEFUL_PCT)


def followed(score: CaseScore) -> bool | None:
    """Whether wear, or a change, is followed as soon as it must be; None for a case without either."""
    if score.change_event is not None:
        return recovered(score)
    return useful_at_third(score) if score.class_name in WEAR_FROM_THE_START else None


def worn_from_the_start(scores: Sequence[CaseScore]) -> list[CaseScore]:
    """Cases whose wear is there from the first event on."""
    return [s for s in scores if s.class_name in WEAR_FROM_THE_START]


def sustained_excess_pct(score: CaseScore) -> float:
    """How much worse than the nominal model the mass is, at the least, in more than three events."""
    excess = np.abs(score.event_errors_pct()) - np.abs(score.event_errors_pct(NOMINAL))
    return float(np.sort(np.nan_to_num(excess, nan=np.inf))[-1 - WORSE_EVENTS])


def x3_ratios(scores: Sequence[CaseScore]) -> list[float]:
    """Ratios of the x3-MSE where they count: nozzle wear alone, not small."""
    worn = (s for s in scores if s.class_name == "orifice_area")
    return [s.x3_ratio for s in worn if abs(s.nozzle_wear) >= SIGNIFICANT_WEAR]


def coverage(scores: Iterable[CaseScore]) -> list[bool]:
    """Whether the interval of event 15's mass holds the truth, one a case, where there is an interval."""
    return known(s.covered(COVERAGE_EVENT) for s in scores)


def rate_coverages(scores: Iterable[CaseScore]) -> list[float]:
    """Share of the open samples whose interval of the rate holds the truth, one a case, where there is one."""
    return known(s.rate_coverage for s in scores)


def violations(scores: Sequence[CaseScore]) -> list[str]:
    """A line for every class and every case that misses a bar."""
    lines = [line for name, cases in by_class(scores).items() for line in _class_violations(name, cases)]
    if worn := worn_from_the_start(scores):
        lines += _below(
            "wear", "within 1 % at the third event", [useful_at_third(s) for s in worn], USEFUL_SHARE, True
        )
    main = [s for s in scores if CLASSES[s.class_name].group is Group.MAIN]
    if len(covered := coverage(main)) >= POOLED_CASES:
        share = float(np.mean(covered))
        if not POOLED_COVERAGE[0] <= share <= POOLED_COVERAGE[1]:
            lines.append(f"all: coverage of the 95 % interval of the mass: {share:.1%}, not 93-97 %")
    if training := [ms for s in main for ms in s.training_ms]:
        lines += _above("all", "training of an event, median [ms]", np.median(training), 10.0)
        lines += _above("all", "training of an event, p99 [ms]", np.percentile(training, 99), 20.0)
    return lines


def wave_violations(scores: Sequence[CaseScore], variant: Variant) -> list[str]:
    """The same of tier B; on a line the structures do not contain only what is valid must be right."""
    lines = [_wrong_line(s) for s in scores if s.wrong_valid]
    if variant is not Variant.PLAIN:
        for s in scores:
            lines += _above(f"{s.class_name} {s.number}", LARGEST, s.largest_error_pct(), VARIANT_PCT)
        return lines
    for name, cases in by_class(scores).items():
        if name in _WAVE_BARS:
            lines += _level_violations(name, cases, _WAVE_BARS[name], "largest")
            if (ratios := x3_ratios(cases)) and min(ratios) < WAVE_X3:
                lines.append(f"{name}: x3-MSE ratio, smallest: {min(ratios):.3g} < {WAVE_X3:g}")
            if covered := coverage(cases):
                low, high = clopper_pearson(sum(covered), len(covered))
                if high < WAVE_COVERAGE[0] or low > WAVE_COVERAGE[1]:
                    share = f"{np.mean(covered):.1%}, not 90-98 %"
                    lines.append(f"{name}: coverage of the 95 % interval of the mass: {share}")
    if shares := rate_coverages(scores):
        lines += _below("all", "coverage of the 95 % interval of the rate", shares, RATE_COVERAGE[0])
    return lines


def slow_sample(took: SampleTime) -> list[str]:
    """A line when a sample takes too long."""
    slowest = max(took.open_us, took.closed_us)
    return list(_above("all", "one sample of the observer at 100 kHz [us]", slowest, SAMPLE_US))


def _class_violations(name: str, cases: list[CaseScore]) -> Iterator[str]:
    group = CLASSES[name].group
    if name in _BARS:
        yield from _level_violations(name, cases, _BARS[name], "p95")
    if name == "healthy":
        ours, theirs = (mass_errors_pct(cases, name) for name in (OBSERVER, NOMINAL))
        if excess := [a - b for a, b in zip(ours, theirs, strict=True)]:
            yield from _above(name, "excess over the nominal model, p95 [%]", np.percentile(excess, 95), 0.25)
    if (ratios := x3_ratios(cases)) and (p5 := float(np.percentile(ratios, 5))) < X3_P5:
        yield f"{name}: x3-MSE ratio, p5: {p5:.3g} < {X3_P5:g}"
    much_worse = [sustained_excess_pct(s) > WORSE_PCT for s in cases]
    if group is Group.STABILITY and (share := float(np.mean(much_worse))) > WORSE_SHARE:
        yield f"{name}: over 1 % worse than the nominal model for more than 3 events: {share:.2%} of the cases"
    if group is Group.MAIN:
        yield from _coverage_violations(name, cases)
        beside = [s for s in cases if s.has(UKF)]
        ours, theirs = (mass_errors_pct(beside, e) for e in (OBSERVER, UKF))
        for what, figure in (("median", np.median), ("largest", np.max)):
            if ours and figure(ours) > figure(theirs):
                yield f"{name}: mass error, {what} [%]: {figure(ours):.3g}, joint UKF {figure(theirs):.3g}"
    for s in cases:
        yield from _case_violations(group, s)


def _level_violations(name: str, cases: Sequence[CaseScore], bars: Bars, of: str) -> Iterator[str]:
    masses, rates = mass_errors_pct(cases), [s.rate_rmse() for s in cases]
    if masses:
        yield from _above(name, f"mass error, {of} [%]", np.percentile(masses, PERCENT[of]), bars.mass_pct)
    if bars.rmse is not None:
        yield from _above(name, f"RMSE, {of} [mm3/ms]", np.percentile(rates, PERCENT[of]), bars.rmse)
    yield from _below(name, "valid share", [s.valid_share for s in cases], bars.valid_share)
    if bars.any_pct is not None:
        for s in cases:
            yield from _above(f"{name} {s.number}", LARGEST, s.largest_error_pct(), bars.any_pct)


def _coverage_violations(name: str, cases: list[CaseScore]) -> Iterator[str]:
    if covered := coverage(cases):
        low, high = clopper_pearson(sum(covered), len(covered))
        if not low <= 0.95 <= high:
            yield f"{name}: coverage of the 95 % interval of the mass: {np.mean(covered):.1%}"
    if shares := rate_coverages(cases):
        mean = float(np.mean(shares))
        if not RATE_COVERAGE[0] <= mean <= RATE_COVERAGE[1]:
            yield f"{name}: coverage of the 95 % interval of the rate: {mean:.1%}, not 90-98 %"


def _case_violations(group: Group, s: CaseScore) -> Iterator[str]:
    place, errors = f"{s.class_name} {s.number}", s.event_errors_pct()
    if s.wrong_valid:
        yield _wrong_line(s)
    if group is Group.MIXED:
        yield from _above(place, LARGEST, s.largest_error_pct(), MIXED_CASE_PCT)
    if group is Group.WAVE and (believed := sum(s.valid[WAVE_JUDGED:])):
        yield f"{place}: {believed} events after the second valid, on a line with travelling waves"
    if s.change_event is not None and not recovered(s):
        error = errors[s.change_event + RECOVERY_EVENTS]
        yield f"{place}: mass error three events after the change [%]: {error:.3g}"
    if group is Group.STABILITY and (excess := sustained_excess_pct(s)) > WORSE_PCT:
        yield f"{place}: more than three events {excess:.3g} % worse than the nominal model"


def _wrong_line(s: CaseScore) -> str:
    return f"{s.class_name} {s.number}: {s.wrong_valid} injections valid and wrong"


def _above(place: str, what: str, value: float | np.floating[Any], bar: float) -> Iterator[str]:
    """A line if a figure is above its bar."""
    if value > bar:
        yield f"{place}: {what}: {value:.3g} > {bar:g}"


def _below(
    place: str, what: str, values: Sequence[float], bar: float, with_count: bool = False
) -> Iterator[str]:
    """A line if the mean of shares is below its bar."""
    if (share := float(np.mean(values))) < bar:
        yield f"{place}: {what}: {share:.1%}{f' of {len(values)} cases' if with_count else ''} < {bar:.0%}"
