"""The observer on recordings of an independent plant whose line pressure hums or has coloured noise."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfilt

from observer_rt.desk.evaluation.evaluate import Evaluation, evaluate
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.files.signals.recording import Recording
from tests.engine.learning.worn_injector import recorded
from tests.observed_plants import bench_at, recording_of
from tests.plants.parameters import Injector
from tests.plants.plant import FIRST_EVENT, PERIOD
from tests.plants.windows import windows_of

EVENTS = 9
SEED = 11
KNOWN_AFTER = 4  # events


def hum(time: NDArray[np.float64]) -> NDArray[np.float64]:
    return 0.5e6 * np.sin(2.0 * math.pi * 47.0 * time)


def coloured(time: NDArray[np.float64]) -> NDArray[np.float64]:
    pole = math.exp(-2.0 * math.pi * 3e3 * float(time[1] - time[0]))
    drive = np.random.default_rng(3).normal(size=time.size)
    return 0.2e6 * math.sqrt(1.0 - pole**2) * np.asarray(lfilter([1.0], [1.0, -pole], drive), np.float64)


def disturbed(extra: NDArray[np.float64]) -> Recording:
    measured = recorded(EVENTS, SEED).measured
    recorded_signals = replace(measured, line_pressure=measured.line_pressure + extra)
    return recording_of(replace(recorded(EVENTS, SEED), measured=recorded_signals))


def evaluated(extra: NDArray[np.float64]) -> Evaluation:
    return evaluate(bench_at(100e3), [disturbed(extra)]).evaluations[0]


@pytest.mark.parametrize("disturbance", [hum, coloured])
def test_masses_are_right_and_valid(disturbance: object) -> None:
    assert callable(disturbance)
    evaluation = evaluated(disturbance(recorded(EVENTS, SEED).measured.time))
    windows, density = windows_of(recorded(EVENTS, SEED), 100e3), Injector().density
    true = np.array(windows.event_masses_mg(recorded(EVENTS, SEED).truth.injection_rate, density))
    rate = np.nan_to_num(evaluation.trace.injection_rate)
    errors = np.array(windows.event_masses_mg(rate, density)) / true - 1.0
    assert [report.valid for report in evaluation.reports[KNOWN_AFTER:]] == [True] * (EVENTS - KNOWN_AFTER)
    assert np.abs(errors[KNOWN_AFTER:]).max() < 0.01
    within = [
        report.mass_ci95 is not None and report.mass_ci95[0] <= 1e-6 * mass <= report.mass_ci95[1]
        for report, mass in zip(evaluation.reports, true, strict=True)
    ]
    assert sum(within[KNOWN_AFTER:]) >= EVENTS - KNOWN_AFTER - 1


def test_hum_does_not_hide_a_line_pressure_that_went_elsewhere() -> None:
    """The watch expects the hum, and no more than that."""
    measured = recorded(EVENTS, SEED).measured
    jump = np.where(measured.time > measured.time[-1] - 0.1, 3e6, 0.0)
    evaluation = evaluated(hum(measured.time) + jump)
    assert not evaluation.reports[-1].valid


def test_what_was_learned_of_the_noise_holds_where_learning_is_off() -> None:
    humming = disturbed(hum(recorded(EVENTS, SEED).measured.time))
    learned = evaluate(bench_at(100e3), [humming]).knowledge
    assert learned.state.learned.colour is not None
    white = replace(learned, state=learned.state.map(lambda each: replace(each, colour=None)))

    def valid(knowledge: Knowledge) -> list[bool]:
        reports = evaluate(bench_at(100e3), [humming], knowledge, learning=False).evaluations[0].reports
        return [report.valid for report in reports[KNOWN_AFTER:]]

    assert valid(learned) == [True] * (EVENTS - KNOWN_AFTER)
    assert not any(valid(white))


@pytest.mark.parametrize("after", [-10e-3, 0.0, 10e-3])
def test_a_noise_that_grows_costs_two_events(after: float) -> None:
    """That in which it does, and the next at most: what was judged by another noise says nothing."""
    measured = recorded(EVENTS, SEED).measured
    random, late = np.random.default_rng(5), measured.time > FIRST_EVENT + 4 * PERIOD + after
    rail, line = (np.where(late, random.normal(0.0, size, late.size), 0.0) for size in (0.28e6, 0.42e6))
    louder = replace(
        measured, rail_pressure=measured.rail_pressure + rail, line_pressure=measured.line_pressure + line
    )
    reports = evaluate(bench_at(100e3), [recording_of(replace(recorded(EVENTS, SEED), measured=louder))])
    valid = [report.valid for report in reports.evaluations[0].reports]
    assert valid[3:].count(False) <= 2


def test_all_channels_through_an_anti_alias_filter() -> None:
    """Neighbours differ little then: by their differences the noise is a tenth of what it is."""
    measured = recorded(EVENTS, SEED).measured

    def filtered(values: NDArray[np.float64]) -> NDArray[np.float64]:
        first = float(np.mean(values[:1000]))
        passed = sosfilt(butter(2, 10e3, fs=100e3, output="sos"), values - first)
        return first + np.asarray(passed, np.float64)

    through = replace(
        measured,
        rail_pressure=filtered(measured.rail_pressure),
        line_pressure=filtered(measured.line_pressure),
        needle_lift=filtered(measured.needle_lift),
    )
    recording = recording_of(replace(recorded(EVENTS, SEED), measured=through))
    reports = evaluate(bench_at(100e3), [recording]).evaluations[0].reports
    assert [report.valid for report in reports[KNOWN_AFTER:]] == [True] * (EVENTS - KNOWN_AFTER)
