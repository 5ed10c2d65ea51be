"""The observer on recordings of an independent plant whose pressure sensors drift, or differ in their gains."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.desk.evaluation.evaluate import Evaluation, evaluate
from observer_rt.engine.stream.state import Reason
from tests.engine.learning.worn_injector import recorded
from tests.observed_plants import bench_at, recording_of
from tests.plants.parameters import Injector
from tests.plants.plant import Signals
from tests.plants.windows import windows_of

EVENTS = 12
SEED = 12
LEARNED = 2  # events, after which a gain is known


def drift(size: float) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    return lambda time: size * np.sin(2.0 * math.pi * 0.4 * time)


def line_drift(measured: Signals) -> Signals:
    return replace(measured, line_pressure=measured.line_pressure + drift(1e6)(measured.time))


def rail_drift(measured: Signals) -> Signals:
    return replace(measured, rail_pressure=measured.rail_pressure + drift(0.5e6)(measured.time))


def line_gain(share: float) -> Callable[[Signals], Signals]:
    return lambda m: replace(m, line_pressure=(1.0 + share) * m.line_pressure)


def rail_gain(share: float) -> Callable[[Signals], Signals]:
    return lambda m: replace(m, rail_pressure=(1.0 + share) * m.rail_pressure)


def evaluated(
    disturbance: Callable[[Signals], Signals], accuracy_percent: float = 0.7
) -> tuple[Evaluation, NDArray[np.float64]]:
    """With the relative mass errors of all events."""
    recording = recording_of(
        replace(recorded(EVENTS, SEED), measured=disturbance(recorded(EVENTS, SEED).measured))
    )
    evaluation = evaluate(bench_at(100e3, None, accuracy_percent), [recording]).evaluations[0]
    windows, density = windows_of(recorded(EVENTS, SEED), 100e3), Injector().density
    rate = np.nan_to_num(evaluation.trace.injection_rate)
    true = np.array(windows.event_masses_mg(recorded(EVENTS, SEED).truth.injection_rate, density))
    return evaluation, np.array(windows.event_masses_mg(rate, density)) / true - 1.0


def are_valid(evaluation: Evaluation) -> list[bool]:
    return [report.valid for report in evaluation.reports[3:]]


@pytest.mark.parametrize("accuracy", [0.0, 0.7])
@pytest.mark.parametrize("disturbance", [line_drift, rail_drift], ids=["line", "rail"])
def test_an_offset_that_drifts_is_followed(
    disturbance: Callable[[Signals], Signals], accuracy: float
) -> None:
    evaluation, errors = evaluated(disturbance, accuracy)
    assert are_valid(evaluation)[1:] == [True] * (EVENTS - 4)
    assert np.abs(errors[3:]).max() < 0.01


@pytest.mark.parametrize(
    "disturbance",
    [line_gain(0.01), line_gain(-0.01), rail_gain(0.01), rail_gain(-0.01)],
    ids=["line +", "line -", "rail +", "rail -"],
)
def test_gains_that_differ_are_shared_between_both_sensors(disturbance: Callable[[Signals], Signals]) -> None:
    """Whose gain is wrong is not known: the masses are wrong by half of it, and their intervals say so."""
    evaluation, errors = evaluated(disturbance)
    assert are_valid(evaluation) == [True] * (EVENTS - 3)
    assert np.abs(errors[LEARNED:]).mean() < 0.0075
    for report, error in list(zip(evaluation.reports, errors, strict=True))[LEARNED:]:
        assert report.mass_ci95 is not None
        low, high = report.mass_ci95
        assert low <= report.mass / (1.0 + error) <= high
        assert high - low < 0.03 * report.mass


@pytest.mark.parametrize("share", [0.022, -0.022])
def test_gains_that_differ_by_much_are_refused_as_an_offset(share: float) -> None:
    evaluation, _ = evaluated(line_gain(share))
    assert {report.reason for report in evaluation.reports[LEARNED:]} == {Reason.PRESSURE_OFFSET}
