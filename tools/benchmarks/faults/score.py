"""What came of a scenario: wrong while valid, found when, valid again when, named or not, close or not."""

from enum import StrEnum

import numpy as np

from observer_rt.foundation.units import MILLIGRAM, MM3_PER_MS
from tests.plants.arrays import Array
from tests.plants.plant import Outcome
from tests.plants.windows import Windows, windows_of
from tools.benchmarks.campaign import Row
from tools.benchmarks.faults.player import Results
from tools.benchmarks.faults.scenario import AND, AT, Scenario

WRONG, WRONG_MASS = 0.03, 0.3 * MILLIGRAM  # of an injection, and at least
CLOSE = 100  # samples between the first one of a window as published, and of the true one
PHANTOM = 3.0 * MM3_PER_MS  # a rate where nothing is injected
WARM_UP = 3  # events until it must be valid
RECOVERY = 3  # events after a fault within which it must be valid again
JUDGED = slice(7, 20)  # events 8-20, where something is wrong throughout
ENOUGH_VALID, CLOSE_PCT = 0.8, 1.0  # share of these events; error of 95 % of their masses
SEVERAL = "several at once"
_REACH = 5e-3  # s from an opening's window to a fault that concerns it
_NOTHING_WRONG = ("NONE", "TOO_FEW_EVENTS", "OUTSIDE_LEARNED_RANGE")


class Verdict(StrEnum):
    """What a recording came to in which something small is wrong throughout."""

    RIGHT = "right"  # enough events valid, and close
    REFUSED = "refused"  # too few events valid, none wrong
    ROUGH = "rough"  # enough events valid, none wrong, but not close
    WRONG = "wrong"


def facts_of(scenario: Scenario, outcome: Outcome, published: Results) -> Row:
    """The scenario as a row, against the truth of its recording.

    wrong_samples: valid ones of injections that are wrong by them, and valid rates where nothing flows, beyond the
    stated time after the first opening; late_samples: those within it, of injections that are wrong by all.
    wrong_summaries: valid, of another mass; free_valid: of injections in which nothing was wrong, whether valid by
    their summaries. found_ms: from the first fault that comes until a sample was not valid, None: none was;
    recovered_after: events from the last fault's end until one had a valid injection, None: none had, or one lasts;
    in_time: None without time; is_named: a reason given is true of a fault, None: none was; verdict: if all lasts.
    """
    density, task = scenario.bench.injector.density, scenario.task
    interval = 1.0 / scenario.bench.sample_rate
    windows = windows_of(outcome, scenario.bench.sample_rate)
    true = windows.masses(outcome.truth.injection_rate, density)
    error = np.where(published.valid, published.rate - outcome.truth.injection_rate, 0.0)
    coming = [each for each in scenario.placed if not each.fault.lasting]
    lasts = len(coming) < len(scenario.placed)
    starts_of = scenario.bench.starts
    begin = min(each.begin for each in coming) if coming else starts_of[JUDGED.start]
    end = max((each.end for each in coming), default=np.inf)
    allowed = max(each.fault.late for each in scenario.placed)
    starts = np.array([window.start for window in windows.ranges]) * interval
    opened = np.array([window.start for window in windows.opened])
    first = int(np.searchsorted(opened * interval, begin))
    limits = np.maximum(WRONG * true, WRONG_MASS)
    inside = np.zeros(published.valid.size, np.bool_)
    wrong_samples = late_samples = 0
    for number, window in enumerate(windows.ranges):
        inside[window] = True
        beyond = window
        if number == first and allowed > 0.0:
            beyond = slice(windows.opened[number].start + round(allowed / interval), window.stop)
        if abs(float(np.sum(error[beyond]))) * interval * density > limits[number]:
            wrong_samples += int(np.sum(published.valid[beyond]))
        elif abs(float(np.sum(error[window]))) * interval * density > limits[number]:
            late_samples += int(np.sum(published.valid[window]))
    wrong_samples += int(np.sum(published.valid & ~inside & (np.abs(published.rate) > PHANTOM)))
    wrong_summaries = _wrong_summaries(published, windows, true)
    got = np.full(true.size, np.nan)
    for summary in (each for each in published.summaries if each.is_valid):
        got[windows.nearest(summary.first)] = summary.mass
    valid = ~np.isnan(got)
    event = np.asarray(outcome.event_of)
    touched = np.unique(event[(starts >= begin - _REACH) & (starts < end + _REACH)])
    after = event[starts >= end]
    first_after = int(after[0]) if after.size else int(event[-1]) + 1
    recovering = (event >= first_after) & (event < first_after + RECOVERY)
    free = ~np.isin(event, touched) & ~recovering & (event >= WARM_UP) & (not lasts)
    again = event[(event >= first_after) & valid]
    verdict = None
    if scenario.is_lasting:
        is_wrong = wrong_samples + wrong_summaries > 0
        verdict = Verdict.WRONG if is_wrong else _verdict(got, true, windows)
    named = _named(published, begin / interval) if verdict in (None, Verdict.REFUSED) else ()
    true_reasons = frozenset().union(*(each.fault.reasons for each in scenario.placed))
    gone = np.flatnonzero(~published.valid[round(begin / interval) : round(min(end, 1e3) / interval)])
    recovered = int(again[0]) - first_after + 1 if again.size and not lasts else None
    must_recover = not lasts and first_after + RECOVERY <= int(event[-1]) + 1
    return {
        "label": task.label,
        "fault": SEVERAL if AND in task.class_name else task.class_name.split(AT)[0],
        "is_wrong": bool(wrong_samples + wrong_summaries),
        "wrong_samples": wrong_samples,
        "late_samples": late_samples,
        "wrong_summaries": wrong_summaries,
        "free_valid": valid[free].tolist(),
        "found_ms": float(1e3 * (gone[0] * interval)) if coming and gone.size else None,
        "recovered_after": recovered,
        "in_time": (recovered or RECOVERY + 1) <= RECOVERY if must_recover else None,
        "is_named": bool(set(named) & true_reasons) if named else None,
        "reasons": list(named),
        "verdict": verdict,
        **{each: verdict is each if verdict else None for each in Verdict},
        "crash": published.crash,
        "crashed": bool(published.crash),
    }


def _verdict(got: Array, true: Array, windows: Windows) -> Verdict:
    """Of a recording in which nothing is wrong, by the valid masses of its injections, NaN of others."""
    errors = 100.0 * np.abs(windows.by_event(got) / windows.by_event(true) - 1.0)[JUDGED]
    if np.mean(~np.isnan(errors)) < ENOUGH_VALID:
        return Verdict.REFUSED
    return Verdict.RIGHT if np.nanpercentile(errors, 95) <= CLOSE_PCT else Verdict.ROUGH


def _named(published: Results, begin: float) -> tuple[str, ...]:
    stream = [name for sample, name in published.reason if sample >= begin]
    injections = [each.reason for each in published.summaries if each.first >= begin and not each.is_valid]
    return tuple(dict.fromkeys(name for name in (*stream, *injections) if name not in _NOTHING_WRONG))


def _wrong_summaries(published: Results, windows: Windows, true: Array) -> int:
    """Valid summaries of a mass that was not injected there."""
    wrong = 0
    for summary in published.summaries:
        number = windows.nearest(summary.first)
        is_there = abs(summary.first - windows.ranges[number].start) <= CLOSE
        mass = float(true[number]) if is_there else 0.0
        wrong += summary.is_valid and not abs(summary.mass - mass) <= max(WRONG * mass, WRONG_MASS)
    return wrong
