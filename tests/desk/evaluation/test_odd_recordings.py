"""Recordings of what a bench seldom does: a rail pressure that is a set value, a needle that sticks for long."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.config.injector_sections import SamplingConfig
from observer_rt.core.stream.stream import RING
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import simulate
from observer_rt.engine.stream.state import Reason
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.model.effects import effective_model
from tests.benches import SAMPLE_RATE
from tests.device import simulated


def reasons_of(recording: Recording) -> list[Reason]:
    (evaluation,) = evaluate(load_bench().exact, [recording]).evaluations
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
    assert (np.ptp(recording.rail_pressure), reasons_of(recording)[2:]) == (0.0, [Reason.NONE] * 2)


BENCH = load_bench().exact.with_sections(sampling=SamplingConfig(rate_hz=SAMPLE_RATE))
BEGIN, END = 0.3503, 1.12  # s, from an opening on


def test_a_needle_that_sticks_for_long() -> None:
    recording = simulated(24)
    assert (END - BEGIN) * SAMPLE_RATE > RING
    held = (recording.time > BEGIN) & (recording.time < END)
    noise = 0.4e-6 * np.random.default_rng(1).normal(size=recording.samples)
    stuck = replace(recording, needle_lift=np.where(held, 290e-6 + noise, recording.needle_lift))
    c = effective_model(BENCH.injector.parameters).coefficients
    (evaluation,) = evaluate(BENCH, [HeldSignals(stuck)], curves_of=c, traces=()).evaluations
    injections = list(evaluation.injections)
    assert [each.start for each in injections] == sorted(each.start for each in injections)
    (long,) = [each for each in injections if each.end - each.start > 0.5]
    assert long.start == pytest.approx(BEGIN, abs=1e-3)
    assert long.end == pytest.approx(END, abs=1e-3)
    assert np.isnan(long.nominal_mass)
    assert all(each.nominal_mass > 0.0 for each in injections if each is not long)
    assert {1, len(injections)} <= set(evaluation.curves)
