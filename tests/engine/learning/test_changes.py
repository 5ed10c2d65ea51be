"""Changes, faults and drifts of injectors by other equations: named, over soon, and never valid and wrong."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.engine.stream.state import Reason
from tests.observed_plants import ObservedRun, bench_at, observed
from tests.plants.laws import NINE_LAWS, NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import FIRST_EVENT, LINE, PERIOD, Bench, Event, Needle, Shot, Surroundings, seen_as

RAIL_PRESSURES = (60e6, 100e6, 140e6, 80e6, 120e6)  # Pa
DURATIONS = (1.4e-3, 0.9e-3, 1.9e-3)  # s
BEGINS = 7  # event, from 0
WARM = 3  # events, before which nothing is known
WRONG = 0.03  # of a mass
HEALTHY = Faults()


def seen(
    faults_at: Callable[[int], Faults],
    events: int,
    around: Surroundings = Surroundings(),  # noqa: B008
    accuracy_percent: float = 0.0,
    laws: Laws = NO_LAWS,
) -> ObservedRun:
    """Single injections at changing operating points, of an injector with such faults."""
    schedule = tuple(
        Event(RAIL_PRESSURES[k % 5], (Shot(7e-6 * (k % 5), DURATIONS[k % 3]),), faults_at(k)) for k in range(events)
    )
    bench = Bench(Injector(), Needle(), schedule, seed=23, around=around, laws=laws)
    run = observed(bench, bench_at(bench.sample_rate, accuracy_percent=accuracy_percent))
    assert not (run.valid & (np.abs(run.errors) > WRONG)).any()
    return run


CHANGES = {
    "nozzle": (Faults(orifice_area=-0.1), Reason.SUDDEN_CHANGE),
    "tip gone": (Faults(orifice_area=0.3), Reason.SUDDEN_CHANGE),
    "seat": (Faults(seat_area=0.2), Reason.SUDDEN_CHANGE),
    "offset": (Faults(line_pressure_sensor_offset=1e6), Reason.PRESSURE_OFFSET),
    "lag": (Faults(line_pressure_sensor_lag=60e-6), Reason.SENSOR_LAG),
    "gain": (Faults(line_pressure_sensor_gain=0.01), Reason.PRESSURE_OFFSET),
}


@pytest.mark.parametrize(("faults", "reason"), CHANGES.values(), ids=CHANGES)
def test_a_change_is_named_and_the_next_event_is_valid(faults: Faults, reason: Reason) -> None:
    accuracy = 0.7 if faults.line_pressure_sensor_gain else 0.0
    run = seen(lambda k: faults if k >= BEGINS else HEALTHY, 13, accuracy_percent=accuracy)
    assert all(run.valid[WARM:BEGINS] + run.valid[BEGINS + 1 :])
    assert run.valid[BEGINS] or run.reports[BEGINS].reason is reason  # a slow sensor changes no mass by much
    assert run.reports[BEGINS].posterior[0][1] > 0.9
    assert np.mean(run.inside) >= 0.9


@pytest.mark.parametrize("lasts", [1, 4])
def test_after_a_fault_the_injector_is_as_it_was(lasts: int) -> None:
    """A line pressure recorded late by .2 ms: no parameter does that."""
    begins, ends = (FIRST_EVENT + PERIOD * (number - 0.2) for number in (BEGINS, BEGINS + lasts))

    def late(time: NDArray[np.float64], pressure: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where((time >= begins) & (time < ends), np.interp(time - 0.2e-3, time, pressure), pressure)

    run = seen(lambda _: HEALTHY, BEGINS + lasts + 4, Surroundings(before_noise=(seen_as(LINE, late),)))
    assert not any(run.valid[BEGINS : BEGINS + lasts])
    assert all(run.valid[BEGINS + lasts + 1 :])
    assert run.reports[BEGINS].posterior[0][0] == "at fault"
    assert run.reports[-1].indicators["orifice_area"].value == pytest.approx(0.0, abs=0.01)


def test_a_slow_drift_is_covered() -> None:
    """A third of a percent an event, which a random walk of the usual size would lag behind."""
    run = seen(lambda k: Faults(orifice_area=-0.2 * k / 60.0), 36)
    assert sum(run.valid) >= 33
    assert np.mean(run.inside) >= 0.93
    assert np.abs(run.errors[WARM:]).max() < 0.015


def test_an_injector_that_comes_back_is_known() -> None:
    run = seen(lambda k: Faults(orifice_area=0.15) if BEGINS <= k < BEGINS + 6 else HEALTHY, BEGINS + 10)
    changed = (BEGINS, BEGINS + 6)
    assert run.valid[WARM:] == [k not in changed for k in range(WARM, BEGINS + 10)]
    assert run.reports[BEGINS + 6].posterior[0][0] == "as when settled"


def test_doubt_of_masses_is_forgotten_with_what_came_after() -> None:
    """Two events whose line pressure is 10 % low are learned as another sensor; then wear goes on, slowly."""

    def faults(k: int) -> Faults:
        low = -0.1 if k in (BEGINS, BEGINS + 1) else 0.0
        return Faults(orifice_area=0.008 * max(k - BEGINS - 4, 0), line_pressure_sensor_gain=low)

    run = seen(faults, BEGINS + 16)
    assert "as when settled" in {report.posterior[0][0] for report in run.reports}
    assert all(run.valid[BEGINS + 8 :])


@pytest.mark.parametrize(("laws", "faults"), NINE_LAWS.values(), ids=NINE_LAWS)
def test_a_law_of_nozzle_or_seat_is_learned(laws: Laws, faults: Faults) -> None:
    run = seen(lambda _: faults, 24, laws=laws)
    assert all(run.valid[WARM:])
    assert np.abs(run.errors[WARM:]).max() < 0.02
    assert np.mean(run.inside) >= 0.9


@pytest.mark.parametrize("faults", [HEALTHY, Faults(orifice_area=0.2), Faults(seat_area=-0.2)])
def test_where_no_law_shows_other_pressures_are_known_at_once(faults: Faults) -> None:
    """The third rail pressure is the highest, and was not seen before."""
    run = seen(lambda _: faults, 12)
    assert all(run.valid[WARM - 1 :])
    assert np.abs(run.errors[WARM:]).max() < 0.008
    assert np.mean(run.inside) >= 0.9
