"""Samples that are means over the sample period that ends at their time: taken for what they are."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import load_bench
from observer_rt.config.injector_sections import Meaning, SamplingConfig
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.simulation.plant import Truth
from observer_rt.files.signals.recording import Recording
from observer_rt.model.effects import sized
from tests.engine.sample_stream import FINE, NOISE, NOMINAL, period_means, true_course

pytestmark = pytest.mark.slow  # compiles what only these tests call, or is a whole closed loop

RATE = 20e3
DURATIONS = (1.1e-3, 0.35e-3, 0.6e-3)  # s
EVENTS = 9  # at as many phases of the samples against the openings
WEAR = 0.25


def truth(worn: bool) -> Truth:
    effects = [sized("orifice_area", v_H=WEAR)] if worn else []
    return true_course(EVENTS, 40e-3 + 1 / (EVENTS * RATE), DURATIONS, *effects)


@cache
def recorded(worn: bool) -> Recording:
    """Means with the noise that the nominal noise at 100 kHz leaves."""
    result = truth(worn)
    random = np.random.default_rng(3)
    signals = (result.rail_pressure, result.needle_lift, result.line_pressure)
    rail, lift, line = (period_means(signal, round(FINE / RATE)) for signal in signals)
    less = np.sqrt(RATE / 100e3)
    return Recording(
        np.arange(rail.size) / RATE,
        rail + random.normal(0.0, less * NOISE.rail_pressure, rail.size),
        lift + random.normal(0.0, less * NOISE.needle_lift, rail.size),
        line + random.normal(0.0, less * NOISE.line_pressure, rail.size),
    )


@cache
def evaluated(worn: bool, meaning: Meaning, stated: bool = True) -> Evaluation:
    """stated: by the bench; else by the recording."""
    bench, recording = load_bench().exact, recorded(worn)
    if stated:
        bench = bench.with_sections(sampling=SamplingConfig(rate_hz=RATE, meaning=meaning))
    else:
        recording = replace(recording, meaning=meaning)
    return evaluate(bench, [recording]).evaluations[0]


def rmse(evaluation: Evaluation, worn: bool, first: int) -> float:
    time = np.arange(evaluation.trace.injection_rate.size) / RATE
    true = np.interp(time, truth(worn).time, truth(worn).injection_rate)
    inside = np.zeros(time.size, np.bool_)
    for report in evaluation.reports[first:]:
        inside[report.start_index : report.end_index] = True
    return float(np.sqrt(np.nanmean((evaluation.trace.injection_rate - true)[inside] ** 2)))


def masses(evaluation: Evaluation, worn: bool, first: int) -> NDArray[np.float64]:
    result = truth(worn)
    errors = []
    for report in evaluation.reports[first:]:
        inside = (result.time >= report.start_index / RATE) & (result.time <= report.end_index / RATE)
        true = NOMINAL.fluid.density_nozzle * float(np.trapezoid(result.injection_rate[inside])) / FINE
        errors.append(report.mass / true - 1.0)
    return np.array(errors)


def test_a_healthy_injector() -> None:
    right, wrong = (evaluated(False, meaning) for meaning in (Meaning.MEAN, Meaning.INSTANT))
    assert len(right.reports) == EVENTS
    assert all(report.valid for report in right.reports[2:])
    assert np.abs(masses(right, False, 0)).max() < 0.008
    assert rmse(right, False, 0) < 0.5e-6
    assert rmse(wrong, False, 0) > 4 * rmse(right, False, 0)


def test_wear_is_learned() -> None:
    right = evaluated(True, Meaning.MEAN)
    assert np.abs(masses(right, True, 4)).max() < 0.01
    assert rmse(right, True, 4) < 0.6e-6
    assert right.reports[-1].valid


def test_a_recording_may_say_it_instead_of_the_bench() -> None:
    by_bench, by_recording = (evaluated(True, Meaning.MEAN, stated) for stated in (True, False))
    np.testing.assert_array_equal(by_bench.trace.injection_rate, by_recording.trace.injection_rate)


@pytest.mark.parametrize("worn", [False, True])
def test_only_the_last_sample_waits_for_the_next(worn: bool) -> None:
    """Rail pressure and lift at its time are only known by what follows it."""
    trace = evaluated(worn, Meaning.MEAN).trace
    assert trace.injection_rate.size == recorded(worn).samples
    assert np.isfinite(trace.injection_rate[-10:-1]).all()
    assert np.isnan(trace.injection_rate[-1])
