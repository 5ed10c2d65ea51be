"""The observer on recordings of an independent plant whose pressure sensors drift, or differ in their gains."""

import math

import numpy as np
import pytest

from observer_rt.engine.stream.state import Reason
from tests.engine.plant_runs import worn_bench
from tests.observed_plants import ObservedRun, bench_at, observed
from tests.plants.plant import LINE, RAIL, Step, seen_as

EVENTS = 12
LEARNED = 2  # events, after which a gain is known


def drift(role: str, size: float) -> Step:
    return seen_as(role, lambda time, values: values + size * np.sin(2.0 * math.pi * 0.4 * time))


def gain(role: str, share: float) -> Step:
    return seen_as(role, lambda _, values: (1.0 + share) * values)


def seen(disturbance: Step, accuracy_percent: float = 0.7) -> ObservedRun:
    return observed(worn_bench(EVENTS, 12, disturbance), bench_at(100e3, accuracy_percent=accuracy_percent))


@pytest.mark.decisive(2)
@pytest.mark.parametrize("disturbance", [drift(LINE, 1e6), drift(RAIL, 0.5e6)], ids=["line", "rail"])
@pytest.mark.parametrize("accuracy", [0.0, 0.7])
def test_an_offset_that_drifts_is_followed(disturbance: Step, accuracy: float) -> None:
    run = seen(disturbance, accuracy)
    assert run.valid[4:] == [True] * (EVENTS - 4)
    assert np.abs(run.errors[3:]).max() < 0.01


@pytest.mark.decisive(2)
@pytest.mark.parametrize(
    "disturbance",
    [gain(LINE, 0.01), gain(RAIL, -0.01), gain(LINE, -0.01), gain(RAIL, 0.01)],
    ids=["line +", "rail -", "line -", "rail +"],
)
def test_gains_that_differ_are_shared_between_both_sensors(disturbance: Step) -> None:
    """Whose gain is wrong is not known: the masses are wrong by half of it, and their intervals say so."""
    run = seen(disturbance)
    assert run.valid[3:] == [True] * (EVENTS - 3)
    assert np.abs(run.errors[LEARNED:]).mean() < 0.0075
    for report, true in list(zip(run.reports, run.true, strict=True))[LEARNED:]:
        assert abs(report.mass - true) <= report.mass_bound < 0.015 * report.mass


@pytest.mark.decisive(1)
@pytest.mark.parametrize("share", [0.022, -0.022])
def test_gains_that_differ_by_much_are_refused_as_an_offset(share: float) -> None:
    run = seen(gain(LINE, share))
    assert {report.reason for report in run.reports[LEARNED:]} == {Reason.PRESSURE_OFFSET}
