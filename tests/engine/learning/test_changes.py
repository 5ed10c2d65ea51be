"""Changes, faults and drifts of injectors by other equations: named, over soon, and never valid and wrong."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.engine.stream.state import Reason
from observer_rt.model.effective import LAG_UNIT
from tests.engine.plant_runs import HEALTHY, in_turn
from tests.observed_plants import ObservedRun, bench_at, observed
from tests.plants.laws import NINE_LAWS, NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import FIRST_EVENT, LIFT, LINE, PERIOD, Bench, Needle, Surroundings, seen_as

BEGINS = 7  # event, from 0
WRONG = 0.03  # of a mass


def seen(
    faults_at: Callable[[int], Faults],
    events: int,
    around: Surroundings = Surroundings(),  # noqa: B008
    accuracy_percent: float = 0.0,
    laws: Laws = NO_LAWS,
) -> ObservedRun:
    """Single injections at changing operating points, of an injector with such faults."""
    bench = Bench(Injector(), Needle(), in_turn(events, faults_at), seed=23, around=around, laws=laws)
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
    assert all(run.valid[:BEGINS] + run.valid[BEGINS + 1 :])
    assert run.valid[BEGINS] or run.reports[BEGINS].reason is reason  # what moves flow or sensor alone is valid
    as_before = dict(run.reports[BEGINS].posterior).get("as before", 0.0)
    assert as_before < 0.05
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
    assert run.reports[BEGINS].reason is Reason.TIME_BASE
    assert run.reports[-1].indicators["orifice_area"].value == pytest.approx(0.0, abs=0.01)


def test_a_slow_drift_is_covered() -> None:
    """A third of a percent an event, which a random walk of the usual size would lag behind."""
    run = seen(lambda k: Faults(orifice_area=-0.2 * k / 60.0), 36)
    assert all(run.valid)
    assert np.mean(run.inside) >= 0.93
    assert np.abs(run.errors).max() < 0.01


def test_an_injector_that_comes_back_is_known() -> None:
    run = seen(lambda k: Faults(orifice_area=0.15) if BEGINS <= k < BEGINS + 6 else HEALTHY, BEGINS + 10)
    assert all(run.valid)
    assert np.abs(run.errors).max() < 0.012


def test_wear_that_goes_on_is_valid_soon_after_a_sensor_that_came_back() -> None:
    """Two events whose line pressure is 10 % low are learned as another sensor; then wear goes on, slowly."""

    def faults(k: int) -> Faults:
        low = -0.1 if k in (BEGINS, BEGINS + 1) else 0.0
        return Faults(orifice_area=0.008 * max(k - BEGINS - 4, 0), line_pressure_sensor_gain=low)

    run = seen(faults, BEGINS + 16)
    assert "another injector" in {report.posterior[0][0] for report in run.reports}
    assert all(run.valid[BEGINS + 8 :])


@pytest.mark.decisive(2)
@pytest.mark.parametrize(("laws", "faults"), NINE_LAWS.values(), ids=NINE_LAWS)
def test_a_law_of_nozzle_or_seat_is_learned(laws: Laws, faults: Faults) -> None:
    run = seen(lambda _: faults, 24, laws=laws)
    assert all(run.valid)
    assert np.abs(run.errors).max() < 0.015
    assert np.mean(run.inside) >= 0.9


@pytest.mark.decisive(2)
@pytest.mark.parametrize("faults", [HEALTHY, Faults(orifice_area=0.2), Faults(seat_area=-0.2)])
def test_where_no_law_shows_other_pressures_are_known_at_once(faults: Faults) -> None:
    """The third rail pressure is the highest, and was not seen before."""
    run = seen(lambda _: faults, 12)
    assert all(run.valid)
    assert np.abs(run.errors).max() < 0.01
    assert np.abs(run.errors[3:]).max() < 0.006
    assert np.mean(run.inside) >= 0.9


@pytest.mark.decisive(2)
@pytest.mark.parametrize(("change", "live", "share"), [(-0.15, 0.03, 0.012), (0.15, 0.03, 0.012), (0.3, 0.02, 0.01)])
def test_an_injection_that_shows_a_jump_is_valid_and_right(change: float, live: float, share: float) -> None:
    """By its own pressures, with its interval; what it would have been before the jump is known."""
    run = seen(lambda k: Faults(orifice_area=change) if k >= BEGINS else HEALTHY, BEGINS + 2)
    report, healthy = run.reports[BEGINS], seen(lambda _: HEALTHY, BEGINS + 2)
    assert all(run.valid)
    assert abs(report.live_mass / run.true[BEGINS] - 1.0) < live
    assert abs(run.errors[BEGINS]) < share
    assert report.predicted_mass == pytest.approx(healthy.true[BEGINS], rel=0.01)
    assert abs(report.mass - run.true[BEGINS]) < report.mass_bound


@pytest.mark.decisive(2)
@pytest.mark.parametrize("wear", [-0.3, 0.0])
@pytest.mark.parametrize("late", [20e-6, 40e-6, 60e-6])
def test_masses_are_right_from_the_first_event_on_where_the_lift_is_late(late: float, wear: float) -> None:
    """The delay is part of what explains them, and is stated."""
    recorded = Surroundings(before_noise=(seen_as(LIFT, lambda time, lift: np.interp(time - late, time, lift)),))
    run = seen(lambda _: Faults(orifice_area=wear), 5, recorded)
    assert all(run.valid)
    assert np.abs(run.errors).max() < 0.01
    assert np.mean(run.inside) >= 0.8
    delays = [report.indicators["needle_lift_sensor_lag"] for report in run.reports]
    assert [delay.value * LAG_UNIT for delay in delays] == pytest.approx([late] * 5, abs=3e-6)


def test_no_mass_is_trusted_where_a_delay_does_not_explain_all_of_a_late_lift() -> None:
    """A filter of 3 kHz rounds it, too."""
    run = seen(lambda _: Faults(lift_sensor_lag=53e-6), 5)
    assert not any(run.valid)
    assert {report.reason for report in run.reports} == {Reason.LIFT_SENSOR_LAG}
