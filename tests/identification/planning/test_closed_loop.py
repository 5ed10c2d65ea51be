"""The loop closed on an independent plant: an ambiguous answer, its plan, the planned measurement, the right name."""

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


def measured(planned: PlannedMeasurement, faults: Faults, seed: int) -> Recording:
    """A planned measurement, made on the plant. A pause below half the period separates the shots of a pair."""
    pressure, energizing = planned.rail_pressure_MPa * 1e6, planned.energizing_ms * 1e-3
    moved = schedule.stroke(schedule.Shot(energizing), 0.0, pressure, NOMINAL)
    assert moved is not None
    paired = planned.pause_ms * 1e-3 < PERIOD / 2.0
    starts = (0.0, energizing + planned.pause_ms * 1e-3) if paired else (0.0,)
    shots = tuple(Shot(start, moved.closed - moved.opening) for start in starts)
    events = (Event(pressure, shots, faults),) * (planned.injections // len(shots))
    return recording_of(record(Bench(Injector(), Needle(), events, seed=seed)))


def discovered(recordings: list[Recording], *also_left: str) -> tuple[Discovery, MeasurementPlan | None]:
    """The discovery, and the plan that would decide between its explanations and the effects of `also_left`."""
    measured = measurements(recordings)
    answer = name_effects(MODEL, measured, SearchOptions(workers=2))
    answer = replace(answer, rivals=(*answer.rivals, *((effect,) for effect in also_left)))
    plan = next_measurement(answer, measured, MODEL, NOT_FITTED, two_injections, lambda _: None)
    return answer, plan


def behind(discovery: Discovery, effect: str) -> float:
    """Difference of -2 log L between an effect and the offset of the rail pressure."""
    statistic = {candidate.ids: candidate.statistic for candidate in discovery.ranking}
    return statistic[(effect,)] - statistic[(OFFSET,)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "faults"),
    [(GAIN, Faults(rail_pressure_sensor_gain=0.01)), (OFFSET, Faults(rail_pressure_sensor_offset=1e6))],
)
def test_the_planned_measurement_leads_to_the_right_name(hidden: str, faults: Faults) -> None:
    """Gain or offset of the rail sensor: at a single rail pressure both have the same signals."""
    recordings = [measured(FIRST, faults, seed=1)]
    # the offset of the line pressure is hardly less likely, and the nearest rival of that of the rail pressure
    before, plan = discovered(recordings, *([LINE_OFFSET] if hidden == OFFSET else []))
    assert before.verdict is Verdict.AMBIGUOUS
    assert {(GAIN,), (OFFSET,)} <= {before.named.ids, *before.rivals}
    assert plan is not None
    assert before.confidence <= plan.confidence <= before.confidence / SURE  # of those left, not of all
    best = plan.measurements[0]
    assert best.confidence > 0.95 > plan.confidence
    assert best.measure is MeasuredQuantity.PRESSURES  # they decide, so no rate need be measured
    assert abs(best.rail_pressure_MPa - 100.0) >= 20.0

    after, _ = discovered([*recordings, measured(best, faults, seed=2)])
    assert after.verdict is Verdict.NAMED
    assert after.named.ids == (hidden,)
    assert after.confidence > 0.95
    if hidden == OFFSET:
        grown = behind(after, LINE_OFFSET) - behind(before, LINE_OFFSET)
        assert grown == pytest.approx(best.separation, rel=0.5)


def test_a_plan_promises_no_decision_where_none_is_possible() -> None:
    """Seat area and lift gain have the same signals: no planned measurement is said to decide between them."""
    recordings = [measured(FIRST, Faults(seat_area=-0.2), seed=3)]
    result, plan = discovered(recordings)
    assert {(result.named.ids), *result.rivals} == {("seat_area",), ("lift_gain",)}
    assert plan is not None
    assert all(one.confidence < 0.75 for one in plan.measurements)


def test_after_a_clear_answer_nothing_is_planned() -> None:
    result, plan = discovered([measured(FIRST, Faults(orifice_area=0.1), seed=4)])
    assert (result.verdict, plan) == (Verdict.NAMED, None)


def test_planned_pressures_go_from_half_the_lowest_to_one_and_a_half_times_the_highest() -> None:
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
