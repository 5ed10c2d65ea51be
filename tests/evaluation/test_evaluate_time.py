"""Recordings through benches whose messages carry no index, or a slower rail pressure: as on the bus."""

from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.evaluation.evaluate import Evaluation, evaluate
from observer_rt.recording.signals.recording import Recording
from observer_rt.simulation.schedule import make_schedule
from observer_rt.simulation.simulate import SimulatedNoise, Simulation, simulate
from tests.service.time_frames import write_time_bench
from tests.service.time_scenarios import NIBBLE, ONE_BASE, SLOW, STAMPS, slow

RATE = 20e3
LOCKED = round(1.05 * RATE)  # samples until clocks are known


@pytest.fixture(scope="module")
def made() -> Simulation:
    schedule = make_schedule([100e6], 24, 0.05, [1.1e-3])
    return simulate(load_injector(), schedule, RATE, (), SimulatedNoise(), seed=4)


@pytest.fixture(scope="module")
def expected(made: Simulation, tmp_path_factory: pytest.TempPathFactory) -> Evaluation:
    """By messages with an index."""
    (evaluation,) = evaluated(tmp_path_factory.mktemp("one_base"), ONE_BASE, made.recording)
    return evaluation


def evaluated(folder: Path, signals: dict[str, str], *recordings: Recording) -> tuple[Evaluation, ...]:
    bench = load_bench(write_time_bench(folder, RATE, signals))
    return evaluate(bench, recordings, learning=False).evaluations


@pytest.mark.parametrize(
    "signals",
    [STAMPS, NIBBLE, slow(SLOW), slow('message = "RailSlow"\nrate_hz = 1e3')],
    ids=["stamps", "counter", "slow rail", "slow rail, same base"],
)
def test_rates_are_those_of_messages_with_an_index(
    tmp_path: Path, made: Simulation, expected: Evaluation, signals: dict[str, str]
) -> None:
    (found,) = evaluated(tmp_path, signals, made.recording)
    late = slice(LOCKED, made.recording.samples - 200)
    assert found.trace.valid[late].all()
    difference = found.trace.injection_rate[late] - expected.trace.injection_rate[late]
    assert np.abs(difference).max() < 1e-6
    assert found.counters.lost_samples == 0


@pytest.mark.parametrize("signals", [STAMPS, NIBBLE], ids=["stamps", "counter"])
def test_second_recording_of_a_history_is_found_again(
    tmp_path: Path, made: Simulation, signals: dict[str, str]
) -> None:
    """Over the pause the count goes on by stamps; the second recording's samples are where they belong."""
    _, second = evaluated(tmp_path, signals, made.recording, made.recording)
    late = slice(LOCKED, made.recording.samples - 200)
    assert second.trace.valid[late].all()
    error = second.trace.injection_rate[late] - made.truth.injection_rate[late]
    assert np.abs(error).max() < 3e-6
