"""What came of a scenario: wrong while valid, how soon it was found and over, and whether it was named."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.units import MILLIGRAM, MM3_PER_MS
from tests.plants.plant import Outcome
from tests.plants.windows import windows_of
from tools.benchmarks.campaign import Task
from tools.benchmarks.faults.player import Published
from tools.benchmarks.faults.scenario import Scenario

WRONG, WRONG_MASS = 0.03, 0.3 * MILLIGRAM  # of an injection, and at least
CLOSE = 100  # samples between the first one of a window as published, and of the true one
PHANTOM = 3.0 * MM3_PER_MS  # a rate where nothing is injected
WARM_UP = 3  # events until it must be valid
RECOVERY = 3  # events after a fault within which it must be valid again


@dataclass(frozen=True)
class FaultScore(Task):
    """One scenario; numbers of samples and of injections.

    wrong_samples: valid ones of injections that are wrong by them, and valid rates where nothing flows, beyond the
    stated time after the first opening; late_samples: those within it, of injections that are wrong by all.
    wrong_summaries: valid, of another mass.
    free, free_valid: injections in which nothing was wrong, and those valid. found_after: s from the first fault
    until a sample was not valid, None: none was; recovered_after: events from the last fault's end until one had a
    valid injection; None: none had. is_named: a reason given meanwhile is true of a fault; None: none was given.
    """

    wrong_samples: int
    late_samples: int
    wrong_summaries: int
    free: int
    free_valid: int
    found_after: float | None
    recovered_after: int | None
    is_named: bool | None
    reasons: tuple[str, ...]
    crash: str


def score(scenario: Scenario, outcome: Outcome, published: Published, density: float) -> FaultScore:
    """Against the truth of the recording."""
    interval = 1.0 / scenario.bench.sample_rate
    windows = windows_of(outcome, scenario.bench.sample_rate)
    true = windows.masses(outcome.truth.injection_rate, density)
    error = np.where(published.valid, published.rate - outcome.truth.injection_rate, 0.0)
    begin = min(each.begin for each in scenario.placed)
    end = max(each.end for each in scenario.placed)
    allowed = max(each.kind.late for each in scenario.placed)
    starts = np.array([window.start for window in windows.ranges]) * interval
    event = np.asarray(outcome.event_of)
    touched = np.unique(event[(starts >= begin - _REACH) & (starts < end + _REACH)])
    wrong_samples = late_samples = 0
    inside = np.zeros(published.valid.size, np.bool_)
    opened = np.array([window.start for window in windows.opened])
    first = int(np.searchsorted(opened * interval, begin))
    for number, window in enumerate(windows.ranges):
        inside[window] = True
        limit = max(WRONG * true[number], WRONG_MASS)
        beyond = window
        if number == first and allowed > 0.0:
            beyond = slice(windows.opened[number].start + round(allowed / interval), window.stop)
        if abs(float(np.sum(error[beyond]))) * interval * density > limit:
            wrong_samples += int(np.sum(published.valid[beyond]))
        elif abs(float(np.sum(error[window]))) * interval * density > limit:
            late_samples += int(np.sum(published.valid[window]))
    wrong_samples += int(np.sum(published.valid & ~inside & (np.abs(published.rate) > PHANTOM)))
    valid = np.array([bool(published.valid[window].all()) for window in windows.opened])
    after = event[starts >= end]
    first_after = int(after[0]) if after.size else int(event[-1]) + 1
    recovering = (event >= first_after) & (event < first_after + RECOVERY)
    free = ~np.isin(event, touched) & ~recovering & (event >= WARM_UP)
    again = event[(event >= first_after) & valid]
    named = _named(scenario, published, begin * scenario.bench.sample_rate)
    true_reasons = frozenset().union(*(each.kind.true_reasons for each in scenario.placed))
    return FaultScore(
        scenario.task.class_name,
        scenario.task.master_seed,
        scenario.task.number,
        wrong_samples,
        late_samples,
        _wrong_summaries(published, windows.ranges, true),
        int(np.sum(free)),
        int(np.sum(free & valid)),
        _found_after(published.valid, begin, end, interval),
        int(again[0]) - first_after + 1 if again.size else None,
        None if not named else bool(set(named) & true_reasons),
        named,
        published.crash,
    )


_REACH = 5e-3  # s from an opening's window to a fault that concerns it


def _found_after(valid: NDArray[np.bool_], begin: float, end: float, interval: float) -> float | None:
    first = round(begin / interval)
    gone = np.flatnonzero(~valid[first : round(end / interval)])
    return float(gone[0] * interval) if gone.size else None


_NOTHING_WRONG = ("NONE", "TOO_FEW_EVENTS", "OUTSIDE_LEARNED_RANGE")


def _named(scenario: Scenario, published: Published, begin: float) -> tuple[str, ...]:
    """Reasons given since the fault began."""
    stream = [name for sample, name in published.reason if sample >= begin]
    injections = [each.reason for each in published.summaries if each.first >= begin and not each.is_valid]
    return tuple(dict.fromkeys(name for name in (*stream, *injections) if name not in _NOTHING_WRONG))


def _wrong_summaries(published: Published, ranges: tuple[slice, ...], true: NDArray[np.float64]) -> int:
    """Valid summaries of a mass that was not injected there."""
    wrong = 0
    for each in published.summaries:
        number = int(np.argmin([abs(each.first - window.start) for window in ranges]))
        is_there = abs(each.first - ranges[number].start) <= CLOSE
        mass = float(true[number]) if is_there else 0.0
        is_wrong = not abs(each.mass - mass) <= max(WRONG * mass, WRONG_MASS)
        wrong += each.is_valid and is_wrong
    return wrong
