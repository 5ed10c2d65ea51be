"""An injector whose needle lift is not recorded: the needle is learned by the commands and the line pressure."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.engine.estimation.scalars import SCALARS
from observer_rt.model.effective import LAG_UNIT
from tests.engine.plant_runs import in_turn
from tests.observed_plants import ObservedRun, bench_at, recording_of
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Needle, record, strokes_of
from tests.plants.windows import true_masses

RAIL_PRESSURES, DURATIONS = (60e6, 100e6, 140e6), (0.6e-3, 1.9e-3, 1.0e-3)
OPENS, CLOSES = 0.32e-3, 0.27e-3  # s after both edges, of the injector file
JITTER = 10e-6  # s
EVENTS = 9


def observed(
    faults: Faults, opens_later: float, closes_later: float, needle: Needle
) -> tuple[ObservedRun, list[float]]:
    """Reports of injections by pressures and commands alone, and the delays learned beyond those of the file [s]."""
    rng = np.random.default_rng(5)
    bench = Bench(Injector(), needle, in_turn(EVENTS, lambda _: faults, RAIL_PRESSURES, DURATIONS), seed=3)
    outcome = record(bench)
    time, level = outcome.measured.time, np.zeros(outcome.measured.time.size)
    for event, start in zip(bench.events, bench.starts, strict=False):
        for opening, _, closing, *_ in strokes_of(event, start, needle, bench.injector.max_lift):
            on, off = rng.normal((opening - OPENS - opens_later, closing - CLOSES - closes_later), JITTER)
            level[(time >= on) & (time < off)] = 1.0
    recording = replace(recording_of(outcome), needle_lift=np.full(time.size, np.nan), energizing=level)
    history = evaluate(bench_at(bench.sample_rate), [recording])
    reports = history.evaluations[0].reports
    delays = SCALARS.needle.of(history.knowledge.in_force)[[0, 2]].tolist()
    return ObservedRun(reports, true_masses(outcome, bench)), delays


@pytest.mark.parametrize(
    ("faults", "opens_later", "closes_later", "needle"),
    [
        (Faults(), 60e-6, -120e-6, Needle(0.9, 0.8)),
        (Faults(orifice_area=0.3), -70e-6, 130e-6, Needle(0.7, 1.0)),
        (Faults(orifice_area=-0.2, seat_area=0.2), 80e-6, 80e-6, Needle()),
    ],
    ids=["healthy", "wear", "coking"],
)
def test_masses_are_right_from_the_first_injection_on(
    faults: Faults, opens_later: float, closes_later: float, needle: Needle
) -> None:
    run_of_events, delays = observed(faults, opens_later, closes_later, needle)
    assert len(run_of_events.reports) == EVENTS
    assert all(run_of_events.valid)
    assert np.abs(run_of_events.errors).max() < 0.015
    assert np.median(np.abs(run_of_events.errors)) < 0.004
    assert np.mean(run_of_events.inside) >= 0.85
    assert delays == pytest.approx([opens_later, closes_later], abs=40e-6)
    last = run_of_events.reports[-1].indicators
    assert last["needle_opens_later"].value * LAG_UNIT == pytest.approx(delays[0], abs=30e-6)
    assert "needle_lift_sensor_lag" not in last
