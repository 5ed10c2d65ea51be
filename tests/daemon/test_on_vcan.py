"""The main test: replay player, daemon and listener are three processes on a real SocketCAN interface."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.desk.evaluation.evaluate import History, evaluate
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.files.formats import read_recording, write_recording
from observer_rt.model.effects import sized
from tests.daemon.end_to_end import (
    RATE,
    SUMMARY,
    ResultFrames,
    decoded,
    output_bus,
    published_rates,
    results_of,
    run_over,
    write_bench,
)

RAIL_PRESSURE = 100e6
ENERGIZING_TIME = 1.9e-3
PERIOD = 0.06


@dataclass(frozen=True)
class Run:
    """One recording over vcan0, and the same through `evaluate`."""

    published: ResultFrames
    history: History
    rate: NDArray[np.float64]  # published, mm3/ms
    count: NDArray[np.int64]
    true_rate: NDArray[np.float64]  # mm3/ms


def over_vcan(
    folder: Path,
    channel: str,
    rate_hz: float,
    speed: float,
    v_h: float,
    injections: int,
    noise: SimulatedNoise | None,
) -> Run:
    schedule = make_schedule([RAIL_PRESSURE], injections, PERIOD, [ENERGIZING_TIME])
    simulation = simulate(
        load_injector(), schedule, rate_hz, (sized("orifice_area", v_H=v_h),), noise, seed=7
    )
    path = folder / "recording.csv"
    write_recording(path, simulation.recording)
    bench = write_bench(folder, "socketcan", channel, rate_hz)
    samples = simulation.recording.samples
    with output_bus("socketcan", channel) as bus:
        results = run_over(bench, path, bus, speed, samples)
    if results.last_status()["DroppedFrames"]:
        pytest.fail("machine too slow: the daemon's socket dropped frames")
    rate, count = published_rates(results.rates, samples)
    history = evaluate(load_bench(bench), [read_recording(path)])
    return Run(results, history, rate, count, simulation.truth.injection_rate / 1e-6)


@pytest.mark.slow
@pytest.mark.vcan
def test_healthy_noise_free_recording_comes_back_as_the_true_rate(tmp_path: Path, vcan: str) -> None:
    run = over_vcan(tmp_path, vcan, 100e3, 0.05, 0.0, 3, None)
    assert_published_once(run)
    assert_equal_to_evaluation(run)
    available = ~np.isnan(run.rate)
    assert available[1000:].all()  # available since 3 ms of standstill, long before the first injection
    assert np.sqrt(np.mean((run.rate - run.true_rate)[available] ** 2)) <= 0.3


@pytest.mark.slow
@pytest.mark.vcan
def test_worn_nozzle_is_learned_on_the_bus(tmp_path: Path, vcan: str) -> None:
    """Over events 4-10 of 10; other wear gives the same frames as `evaluate`, which is judged by its own tests."""
    run = over_vcan(tmp_path, vcan, 50e3, 0.1, 0.3, 10, SimulatedNoise())
    assert_published_once(run)
    assert_equal_to_evaluation(run)
    summaries = [decoded(SUMMARY, payload) for payload in run.published.summaries]
    assert [s["InjectionNumber"] for s in summaries] == list(range(1, 11))
    assert [s["Valid"] for s in summaries] == [0, 0] + 8 * [1]
    squares = []
    for summary in summaries[3:]:
        window = slice(int(summary["SampleIndex"]), int(summary["EndIndex"]) + 1)
        squares.append(np.mean((run.rate[window] - run.true_rate[window]) ** 2))
        true_mass = float(np.trapezoid(run.true_rate[window])) / 50e3 * 1e3 * 0.83  # mg
        assert summary["Mass"] == pytest.approx(true_mass, rel=0.01)
    assert np.sqrt(np.mean(squares)) <= 1.0


def assert_published_once(run: Run) -> None:
    assert (run.count == 1).all()
    assert len(run.published.rates) == -(-len(run.count) // 28)  # and none extra
    starts = [int(decoded(RATE, payload)["SampleIndex"]) for payload in run.published.rates]
    assert starts == sorted(starts)
    # the status frame after SIGTERM tells of the samples too that the look-ahead held until then
    assert run.published.last_status()["SamplesProcessed"] == len(run.count)


def assert_equal_to_evaluation(run: Run) -> None:
    """`evaluate --bench` and the daemon on vcan give the same frames, bit for bit, learning included."""
    assert run.published.results == results_of(run.history.frames)
