"""Pilot valve and needle that go by the injector's commands, as a recording or the bus has them."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.schedule import Shot as Command
from observer_rt.desk.simulation.schedule import energized, make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.engine.estimation.parameters import VALVE_LAW
from observer_rt.engine.reports.indicators import Estimate
from observer_rt.engine.stream.state import Reason
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.model.effective import LAG_UNIT
from observer_rt.model.effects import sized
from observer_rt.model.hydraulics import COMMAND_DELAY
from tests.benches import SAMPLE_RATE, sample_bench
from tests.daemon.pulses import EnergizingBy, Pulses, blocks, durations, on_change, pulse_bench, samples
from tests.device import merged, run
from tests.engine.learning.test_control_flow import DURATIONS, FIRST, RAIL_PRESSURES
from tests.engine.plant_runs import in_turn
from tests.observed_plants import ObservedRun, bench_at, commanded
from tests.plants.laws import Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Needle, record
from tests.plants.windows import true_masses, windows_of
from tools.benchmarks.faults.bench import bouncing, smooth

FOUND = (6e-6, Faults(seat_area=-0.1))


@cache
def learned(
    flow: float, faults: Faults, opens_after: float, shuts_after: float, late: float = 0.0
) -> tuple[ObservedRun, list[float]]:
    """Events after the first pass at a flow [m3/s], and delays of the valve [s]; late: column of commands [s]."""
    events, laws = in_turn(18, lambda _: faults, RAIL_PRESSURES, DURATIONS), Laws(control_flow=flow)
    bench = Bench(Injector(), Needle(), events, seed=3, laws=laws)
    outcome = record(bench)
    before = laws.control_lead + opens_after, laws.control_trail + shuts_after
    history = evaluate(bench_at(bench.sample_rate), [commanded(bench, outcome, *before, late=late)])
    masses = windows_of(outcome, bench.sample_rate).masses(outcome.truth.injection_rate, bench.injector.density)
    changes = VALVE_LAW.of(history.knowledge.in_force)[:2]
    return ObservedRun(history.evaluations[0].reports, masses)[FIRST:], [COMMAND_DELAY - each for each in changes]


@pytest.mark.decisive(1)
@pytest.mark.parametrize(
    ("flow", "faults", "opens_after", "shuts_after"),
    [(*FOUND, 0.15e-3, 0.05e-3), (1.5e-6, Faults(orifice_area=-0.15), 0.1e-3, 0.1e-3)],
)
def test_flow_and_delays_beside_wear(flow: float, faults: Faults, opens_after: float, shuts_after: float) -> None:
    run_of_events, delays = learned(flow, faults, opens_after, shuts_after)
    assert all(run_of_events.valid)
    assert np.mean(run_of_events.inside) >= 0.9
    assert np.abs(run_of_events.errors).max() < 0.015
    size = run_of_events.reports[-1].indicators["control_flow"]
    assert size.sigma is not None
    assert 60e-6 * size.value == pytest.approx(flow, abs=4.0 * 60e-6 * size.sigma)
    assert delays == pytest.approx([opens_after, shuts_after], abs=15e-6)


def test_a_command_goes_by_the_sample_at_which_it_comes() -> None:
    """A delay that is learned would hide commands that are some samples off."""
    (_, delays), (_, late) = (learned(*FOUND, 0.15e-3, 0.05e-3, late) for late in (0.0, 40e-6))
    assert np.subtract(delays, late) == pytest.approx(40e-6, abs=3e-6)


@pytest.mark.decisive(1)
@pytest.mark.parametrize(
    ("faults", "opens_later", "closes_later", "needle"),
    [
        (Faults(), 60e-6, -120e-6, Needle(0.9, 0.8)),
        (Faults(orifice_area=0.3), -70e-6, 130e-6, Needle(0.7, 1.0)),
        (Faults(orifice_area=-0.2, seat_area=0.2), 80e-6, 80e-6, Needle()),
    ],
)
def test_without_the_lift_masses_are_right_from_the_first_injection_on(
    faults: Faults, opens_later: float, closes_later: float, needle: Needle
) -> None:
    events = in_turn(9, lambda _: faults, (60e6, 100e6, 140e6), (0.6e-3, 1.9e-3, 1.0e-3))
    run_of_events = without_lift(Bench(Injector(), needle, events, seed=3), opens_later, closes_later)
    assert all(run_of_events.valid)
    assert np.abs(run_of_events.errors).max() < 0.01
    assert np.median(np.abs(run_of_events.errors)) < 0.004
    assert np.mean(run_of_events.inside) >= 0.85
    indicators = run_of_events.reports[-1].indicators
    delays = [indicators[name].value * LAG_UNIT for name in ("needle_opens_later", "needle_closes_later")]
    assert delays == pytest.approx([opens_later, closes_later], abs=30e-6)
    assert indicators["needle_bounces"] == Estimate(0.0, 0.0)  # it does not pay


@pytest.mark.decisive(1)
def test_without_the_lift_the_valve_is_as_far_ahead_of_the_needle_as_the_file_says() -> None:
    """It opens 20 us and shuts 200 us after the edges of the command. A first injection tells too little of both."""
    laws = Laws(control_flow=6e-6, control_lead=0.29e-3, control_trail=0.11e-3, control_moves=40e-6)
    events = in_turn(4, lambda _: Faults(), (60e6, 100e6, 140e6), (0.6e-3, 1.9e-3, 1.0e-3))
    stated = {"control_flow": 6e-6, "control_start": 0.29e-3, "control_end": 0.11e-3}
    run_of_events = without_lift(Bench(Injector(), Needle(), events, seed=3, laws=laws), 0.0, 0.0, **stated)
    assert run_of_events.valid == [False] + 3 * [True]
    assert (np.abs(run_of_events.errors) < [0.003, 0.006, 0.006, 0.006]).all()


def without_lift(bench: Bench, opens_later: float, closes_later: float, **line: float) -> ObservedRun:
    """Masses by event: a needle that bounces opens twice; line: numbers of the injector's file."""
    observer, outcome = bench_at(bench.sample_rate), record(bench)
    injector = observer.injector.parameters
    before = injector.needle_law.opening_delay + opens_later, injector.needle_law.closing_delay + closes_later
    recording = commanded(bench, outcome, *before, jitter=10e-6).without_lift()
    injector = injector.model_copy(update={"line": injector.line.model_copy(update=line)})
    reports = evaluate(observer.with_parameters(injector), [recording]).evaluations[0].reports
    return ObservedRun(reports, np.bincount(outcome.event_of, true_masses(outcome, bench)).astype(np.float64))


@pytest.mark.decisive(1)
@pytest.mark.parametrize("faults", [Faults(), Faults(line_friction=2.0)], ids=["healthy", "friction"])
def test_a_needle_that_bounces_is_learned_by_its_commands(faults: Faults) -> None:
    """A hop of 25 um, 40 to 100 us after the landing, which is no half sine."""
    events = in_turn(9, lambda _: faults, (60e6, 100e6, 140e6), (0.6e-3, 1.9e-3, 1.0e-3))
    bench = bouncing(Bench(Injector(), Needle(0.9, 0.8), events, seed=3), 25.0, np.random.default_rng(0))
    run_of_events = without_lift(bench, 60e-6, -120e-6)
    assert all(run_of_events.valid)
    assert np.abs(run_of_events.errors).max() < 0.01
    low, high = run_of_events.reports[-1].indicators["needle_bounces"].ci95 or (0.0, 0.0)
    assert 0.5 < low < high < 2.5
    assert high - low < 0.6


def test_a_late_line_sensor_is_not_taken_for_a_needle_that_bounces() -> None:
    """One injection does not show its rate well enough to be valid; the next ones do."""
    late = Faults(line_pressure_sensor_lag=40e-6)
    events = in_turn(7, lambda _: late, (60e6, 100e6, 140e6), (0.6e-3, 1.9e-3, 1.0e-3))
    run_of_events = without_lift(Bench(Injector(), Needle(0.9, 0.8), events, seed=6), 50e-6, 100e-6)
    assert run_of_events.valid == [False] + 6 * [True]
    for report in run_of_events.reports[1:]:
        sizes = [report.indicators[name].value for name in ("line_pressure_sensor_lag", "needle_closes_later")]
        assert LAG_UNIT * np.array(sizes) == pytest.approx([40e-6, 100e-6], abs=10e-6)


@pytest.mark.decisive(2)
@pytest.mark.parametrize(
    ("opens_later", "closes_later", "needle", "is_found"),
    [(26e-6, 133e-6, Needle(0.76, 0.89), False), (40e-6, -60e-6, Needle(0.75, 0.92), True)],
)
def test_a_late_line_sensor_beside_a_needle_slow_near_its_seat_is_found_or_doubted(
    opens_later: float, closes_later: float, needle: Needle, is_found: bool
) -> None:
    """No model has that needle: the lag may look like a bounce and other delays, which are not valid then."""
    late, points = Faults(line_pressure_sensor_lag=40e-6), ((140e6, 60e6, 100e6), (1.9e-3, 1.0e-3, 0.6e-3))
    bench = Bench(Injector(), needle, in_turn(9, lambda _: late, *points), seed=9)
    _, *reports = without_lift(smooth(bench, 20.0, np.random.default_rng(0)), opens_later, closes_later).reports
    lags = [LAG_UNIT * report.indicators["line_pressure_sensor_lag"].value for report in reports if report.valid]
    assert lags == pytest.approx([40e-6] * len(lags), abs=5e-6)
    assert (len(lags) >= 6, Reason.TIME_BASE in [report.reason for report in reports]) == (is_found, not is_found)


@pytest.mark.decisive(2)
@pytest.mark.parametrize("has_lift", [True, False])
@pytest.mark.parametrize(
    ("lines", "frames"),
    [
        (EnergizingBy.LEVEL, on_change),
        (EnergizingBy.TIME, durations),
        (EnergizingBy.LEVELS_IN_BLOCK, lambda pulses: blocks(pulses, 0.0, 0.6)),
    ],
    ids=["level", "duration", "block"],
)
def test_on_the_bus_it_is_as_in_a_recording(
    tmp_path: Path, lines: str, frames: Callable[[Pulses], list[TimedFrame]], has_lift: bool
) -> None:
    """Frames tell of a command some samples after it; what was observed meanwhile is observed again."""
    schedule = make_schedule([100e6], 8, 0.05, shots=(Command(1.1e-3),))
    worn = sized("orifice_area", v_H=0.1), sized("control_flow", c=4e-6)
    seen = simulate(load_injector(), schedule, SAMPLE_RATE, worn, SimulatedNoise(), seed=8).recording
    pulses = [(event.start, event.shots[0].duration) for event in schedule.events]
    path, column = pulse_bench(tmp_path, lines), replace(seen, energizing=energized(schedule, seen.time))
    if not has_lift:
        before, _, after = path.read_text().partition("[signals.needle_lift]")
        path.write_text(before + after[after.index("[signals.line_pressure]") :])
        column = column.without_lift()
    live = run(path, merged(samples(seen), frames(pulses)))
    offline = evaluate(load_bench(sample_bench(tmp_path)), [column]).evaluations[0].reports
    assert [report.valid for report in live.reports] == [report.valid for report in offline]
    masses = [[report.mass for report in reports] for reports in (live.reports, offline)]
    assert masses[0] == pytest.approx(masses[1], rel=1e-3)
    assert 60e-6 * live.reports[-1].indicators["control_flow"].value == pytest.approx(4e-6, rel=0.1)
