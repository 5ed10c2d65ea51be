"""A rail pressure that does not move at all: a set value, not a measured one."""

from dataclasses import replace

import numpy as np

from observer_rt.config.bench import EXAMPLE_BENCH, load_bench, load_injector
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import simulate
from observer_rt.engine.stream.state import Reason
from observer_rt.files.signals.recording import Recording
from tests.device import simulated


def reasons_of(recording: Recording) -> list[Reason]:
    (evaluation,) = evaluate(load_bench(EXAMPLE_BENCH), [recording]).evaluations
    return [report.reason for report in evaluation.reports]


def test_a_set_value_in_place_of_the_measured_one_makes_nothing_valid() -> None:
    recording = simulated(injections=5, v_h=0.0)
    held = replace(recording, rail_pressure=np.full(recording.samples, 100e6))
    assert reasons_of(held)[2:] == [Reason.INPUT_FROZEN] * 3
    assert reasons_of(recording)[2:] == [Reason.NONE] * 3


def test_it_is_over_once_the_pressure_moves_again() -> None:
    recording = simulated(injections=10, v_h=0.0)
    held = recording.rail_pressure.copy()
    held[: round(0.29 * recording.sample_rate)] = 100e6  # of three injections of ten
    result = reasons_of(replace(recording, rail_pressure=held))
    assert result[2] is Reason.INPUT_FROZEN
    assert result[-2:] == [Reason.NONE] * 2


def test_a_computed_recording_without_noise_keeps_its_rail_pressure() -> None:
    schedule = make_schedule([100e6], 4, 0.05, [1.1e-3])
    recording = simulate(load_injector(), schedule, 50e3).recording
    assert np.ptp(recording.rail_pressure) == 0.0
    assert reasons_of(recording)[2:] == [Reason.NONE] * 2
