"""The loop closed on a plant of other equations: ambiguous, planned, measured as planned, named rightly."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from observer_rt.desk.simulation import schedule
from observer_rt.desk.simulation.simulate import two_injections
from observer_rt.engine.learning.healthy import NOT_FITTED
from observer_rt.files.signals.recording import Recording
from observer_rt.identification.discovery.discover import next_measurement
from observer_rt.identification.discovery.search.results import SURE, Discovery, Verdict
from observer_rt.identification.discovery.search.verdict import SearchOptions, name_effects
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.identification.planning.plan import (
    MeasurementPlan,
    PlannedMeasurement,
    points_for,
    write_schedule,
)
from observer_rt.identification.planning.separation import MeasuredQuantity
from observer_rt.model.effects import effective_model
from tests.identification.discovery.hidden import NOMINAL
from tests.observed_plants import recording_of
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import PERIOD, Bench, Event, Needle, Shot, record

MODEL = effective_model(NOMINAL)
GAIN, OFFSET = "rail_pressure_sensor_gain", "rail_pressure_sensor_offset"
LINE_OFFSET = "line_pressure_sensor_offset"
FIRST = PlannedMeasurement(
    rail_pressure_MPa=100.0,
    energizing_ms=1.2,
    pause_ms=60.0,
    injections=4,
    measure=MeasuredQuantity.PRESSURES,
    separation=0.0,
    confidence=0.0,
    masses_mg=(),
)


def measured(planned_measurement: PlannedMeasurement, faults: Faults, seed: int) -> Recording:
    """A planned measurement, made on the plant. A short pause is one within pairs."""
    pressure, energizing = (
        planned_measurement.rail_pressure_MPa * 1e6,
        planned_measurement.energizing_ms * 1e-3,
    )
    moved = schedule.stroke(schedule.Shot(energizing), 0.0, pressure, NOMINAL)
    assert moved is not None
    paired = planned_measurement.pause_ms * 1e-3 < PERIOD / 2.0
    starts = (0.0, energizing + planned_measurement.pause_ms * 1e-3) if paired else (0.0,)
    shots = tuple(Shot(start, moved.closed - moved.opening) for start in starts)
    events = (Event(pressure, shots, faults),) * (planned_measurement.injections // len(shots))
    return recording_of(record(Bench(Injector(), Needle(), events, seed=seed)))


def discovered(recordings: list[Recording], *also_left: str) -> tuple[Discovery, MeasurementPlan | None]:
    """The discovery, and the plan that would distinguish its effects from others that are left."""
    measured_recordings = measurements(recordings)
    answer = name_effects(MODEL, measured_recordings, SearchOptions(workers=2))
    answer = replace(answer, rivals=(*answer.rivals, *((effect,) for effect in also_left)))
    plan = next_measurement(answer, measured_recordings, MODEL, NOT_FITTED, two_injections, lambda _: None)
    return answer, plan


def behind(discovery: Discovery, effect: str) -> float:
    """How far an effect is behind the offset of the rail pressure."""
    statistic = {one.ids: one.statistic for one in discovery.ranking}
    return statistic[(effect,)] - statistic[(OFFSET,)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "faults"),
    [(GAIN, Faults(rail_pressure_sensor_gain=0.01)), (OFFSET, Faults(rail_pressure_sensor_offset=1e6))],
)
def test_what_is_measured_as_planned_decides_rightly(hidden: str, faults: Faults) -> None:
    """Factor or offset: at one rail pressure nothing tells them apart."""
    recordings = [measured(FIRST, faults, seed=1)]
    # the offset of the line pressure, hardly less likely, is what is nearest to that of the rail pressure
    before, plan = discovered(recordings, *([LINE_OFFSET] if hidden == OFFSET else []))
    assert before.verdict is Verdict.AMBIGUOUS
    assert {(GAIN,), (OFFSET,)} <= {before.named.ids, *before.rivals}
    assert plan is not None
    assert before.confidence <= plan.confidence <= before.confidence / SURE  # of those left, not of all
    best = plan.measurements[0]
    assert best.confidence > 0.95 > plan.confidence
    assert (
        best.measure is MeasuredQuantity.PRESSURES
    )  # what decides without more is not asked to measure more
    assert abs(best.rail_pressure_MPa - 100.0) >= 20.0

    after, _ = discovered([*recordings, measured(best, faults, seed=2)])
    assert after.verdict is Verdict.NAMED
    assert after.named.ids == (hidden,)
    assert after.confidence > 0.95
    if hidden == OFFSET:
        grown = behind(after, LINE_OFFSET) - behind(before, LINE_OFFSET)
        assert grown == pytest.approx(best.separation, rel=0.5)


def test_nothing_promises_what_no_measurement_of_these_signals_tells() -> None:
    """Seat area and lift gain: a plan says that it would not decide, and asks for the rate all the same."""
    recordings = [measured(FIRST, Faults(seat_area=-0.2), seed=3)]
    result, plan = discovered(recordings)
    assert {(result.named.ids), *result.rivals} == {("seat_area",), ("lift_gain",)}
    assert plan is not None
    assert all(one.confidence < 0.75 for one in plan.measurements)


def test_after_a_clear_answer_nothing_is_planned() -> None:
    result, plan = discovered([measured(FIRST, Faults(orifice_area=0.1), seed=4)])
    assert (result.verdict, plan) == (Verdict.NAMED, None)


def test_points_lie_about_what_was_recorded() -> None:
    (measurement,) = measurements([measured(FIRST, Faults(), seed=5)])
    pressures = {
        point.rail_pressure for point in points_for([measurement, replace(measurement, rail_pressure=140e6)])
    }
    assert pressures == {20e6 * step for step in range(3, 11)}


def test_a_schedule_has_a_step_a_line_in_the_units_of_its_header(tmp_path: Path) -> None:
    plan = MeasurementPlan(rivals=("a", "b"), confidence=0.5, measurements=(FIRST,))
    write_schedule(tmp_path / "plan.csv", plan)
    header, row = csv.reader((tmp_path / "plan.csv").open(encoding="utf-8"))
    assert header == ["step", "rail_pressure_MPa", "energizing_ms", "pause_ms", "injections", "measure"]
    assert row == ["1", "100", "1.2", "60", "4", "pressures and lift"]
