"""A pilot valve that goes by the injector's commands, as a recording or the bus has them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.schedule import Shot as Command
from observer_rt.desk.simulation.schedule import energized, make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.engine.estimation.scalars import SCALARS
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.model.effects import sized
from observer_rt.model.hydraulics import DELAY
from tests.benches import SAMPLE_RATE, sample_bench
from tests.daemon.pulses import EnergizingBy, Pulses, blocks, durations, on_change, pulse_bench, samples
from tests.device import merged, run
from tests.engine.learning.test_control_flow import DURATIONS, FIRST, RAIL_PRESSURES
from tests.engine.plant_runs import in_turn
from tests.observed_plants import ObservedRun, bench_at, recording_of
from tests.plants.laws import Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Needle, record, strokes_of
from tests.plants.windows import windows_of


def learned(
    flow: float, faults: Faults, opens_after: float, shuts_after: float, late: float = 0.0
) -> tuple[ObservedRun, list[float]]:
    """Events after the first pass over the points, and how long after the commands the valve opens and shuts [s].

    flow: at 100 MPa [m3/s]; late: of the column of the commands [s].
    """
    events, laws = in_turn(18, lambda _: faults, RAIL_PRESSURES, DURATIONS), Laws(control_flow=flow)
    bench = Bench(Injector(), Needle(), events, seed=3, laws=laws)
    outcome = record(bench)
    time, level = outcome.measured.time - late, np.zeros(outcome.measured.time.size)
    for event, start in zip(bench.events, bench.starts, strict=False):
        for opening, _, closing, *_ in strokes_of(event, start, bench.needle, bench.injector.max_lift):
            level[time >= opening - laws.control_lead - opens_after] = 1.0
            level[time >= closing - laws.control_trail - shuts_after] = 0.0
    recording = replace(recording_of(outcome), energizing=level)
    history = evaluate(bench_at(bench.sample_rate), [recording])
    masses = windows_of(outcome, bench.sample_rate).masses(outcome.truth.injection_rate, bench.injector.density)
    changes = SCALARS.valve.of(history.knowledge.in_force)[:2]
    return ObservedRun(history.evaluations[0].reports, masses)[FIRST:], [DELAY - each for each in changes]


@pytest.mark.parametrize(
    ("flow", "faults", "opens_after", "shuts_after"),
    [(1.5e-6, Faults(orifice_area=-0.15), 0.1e-3, 0.1e-3), (6e-6, Faults(seat_area=-0.1), 0.15e-3, 0.05e-3)],
)
def test_flow_and_delays_are_found_beside_wear(
    flow: float, faults: Faults, opens_after: float, shuts_after: float
) -> None:
    run_of_events, delays = learned(flow, faults, opens_after, shuts_after)
    assert all(run_of_events.valid)
    assert np.mean(run_of_events.inside) >= 0.9
    assert np.abs(run_of_events.errors).max() < 0.01
    size = run_of_events.reports[-1].indicators["control_flow"]
    assert size.sigma is not None
    assert 60e-6 * size.value == pytest.approx(flow, abs=4.0 * 60e-6 * size.sigma)
    assert delays == pytest.approx([opens_after, shuts_after], abs=15e-6)


def test_a_command_goes_by_the_sample_at_which_it_comes() -> None:
    """A delay that is learned would hide commands that are some samples off."""
    (_, delays), (_, late) = (learned(6e-6, Faults(), 0.1e-3, 0.1e-3, late) for late in (0.0, 40e-6))
    assert np.subtract(delays, late) == pytest.approx(40e-6, abs=3e-6)


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
    tmp_path: Path, lines: str, frames: Callable[[Pulses], list[TimedFrame]]
) -> None:
    """Frames tell of a command some samples after it; what was observed meanwhile is observed again."""
    schedule = make_schedule([100e6], 8, 0.05, shots=(Command(1.1e-3),))
    worn = sized("orifice_area", v_H=0.1), sized("control_flow", c=4e-6)
    seen = simulate(load_injector(), schedule, SAMPLE_RATE, worn, SimulatedNoise(), seed=8).recording
    pulses = [(event.start, event.shots[0].duration) for event in schedule.events]
    live = run(pulse_bench(tmp_path, lines), merged(samples(seen), frames(pulses)))
    column = replace(seen, energizing=energized(schedule, seen.time))
    offline = evaluate(load_bench(sample_bench(tmp_path)), [column]).evaluations[0].reports
    assert [report.valid for report in live.reports] == [report.valid for report in offline]
    masses = [[report.mass for report in reports] for reports in (live.reports, offline)]
    assert masses[0] == pytest.approx(masses[1], rel=1e-3)
    assert 60e-6 * live.reports[-1].indicators["control_flow"].value == pytest.approx(4e-6, rel=0.1)
