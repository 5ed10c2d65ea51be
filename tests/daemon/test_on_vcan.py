"""The main test: replay player, daemon and listener are three processes on a real SocketCAN interface."""

from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.files.formats import read_recording, write_recording
from observer_rt.model.effects import sized
from tests.daemon import end_to_end

RATE_HZ = 50e3


@pytest.mark.slow
@pytest.mark.vcan
def test_worn_nozzle_is_learned_on_the_bus(tmp_path: Path, vcan: str) -> None:
    """Over events 4-10 of 10; other wear gives the same frames as `evaluate`, which is judged by its own tests."""
    schedule = make_schedule([100e6], 10, 0.06, [1.9e-3])
    worn = (sized("orifice_area", v_H=0.3),)
    simulation = simulate(load_injector(), schedule, RATE_HZ, worn, SimulatedNoise(), seed=7)
    path, samples = tmp_path / "recording.csv", simulation.recording.samples
    write_recording(path, simulation.recording)
    bench = end_to_end.write_bench(tmp_path, "socketcan", vcan, RATE_HZ)
    with end_to_end.output_bus("socketcan", vcan) as bus:
        published = end_to_end.run_over(bench, path, bus, 0.1, samples)
    last = published.last_status()
    if last["DroppedFrames"]:
        pytest.fail("machine too slow: the daemon's socket dropped frames")
    rate, count = end_to_end.published_rates(published.rates, samples)
    assert (count == 1).all()
    assert len(published.rates) == -(-samples // 28)  # and none extra
    starts = [int(end_to_end.decoded(end_to_end.RATE, each)["SampleIndex"]) for each in published.rates]
    assert (starts, last["SamplesProcessed"]) == (sorted(starts), samples)
    evaluated = evaluate(load_bench(bench), [read_recording(path)]).frames  # bit for bit, learning included
    assert published.results == end_to_end.results_of(evaluated)
    summaries = [end_to_end.decoded(end_to_end.SUMMARY, payload) for payload in published.summaries]
    assert [s["InjectionNumber"] for s in summaries] == list(range(1, 11))
    assert [s["Valid"] for s in summaries] == 10 * [1]
    true_rate = simulation.truth.injection_rate / 1e-6  # mm3/ms
    squares = []
    for summary in summaries[3:]:
        window = slice(int(summary["SampleIndex"]), int(summary["EndIndex"]) + 1)
        squares.append(np.mean((rate[window] - true_rate[window]) ** 2))
        true_mass = float(np.trapezoid(true_rate[window])) / RATE_HZ * 1e3 * 0.83  # mg
        assert summary["Mass"] == pytest.approx(true_mass, rel=0.01)
    assert np.sqrt(np.mean(squares)) <= 1.0
