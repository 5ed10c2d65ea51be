"""The daemon on a real SocketCAN interface that carries less than is sent: results wait, none is lost or wrong."""

from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.evaluation.evaluate import evaluate
from tests.device import frames_of, worn_recording
from tests.interface import FRAME_BYTES, OwnInterface
from tests.service.end_to_end import RATE, SUMMARY
from tests.service.participants import bench_file, over_bus

BUS = 1000  # frames/s: fewer than the slowest machine sends
QUEUE = 20  # frames


@pytest.mark.vcan
def test_inputs_and_results_wait_for_one_full_queue(own_interface: OwnInterface, tmp_path: Path) -> None:
    """Replay sends as fast as it may: it and the daemon find the queue full, and share what leaves it."""
    own_interface.slow_down(BUS * FRAME_BYTES, QUEUE * FRAME_BYTES)
    path = bench_file(tmp_path, own_interface.name, "socketcan")
    bench = load_bench(path)
    recording = worn_recording(2)
    frames = frames_of(bench, recording)
    expected = evaluate(bench, [recording]).frames
    heard, daemon = over_bus(path, frames)
    assert own_interface.refused > 0
    assert (daemon.unsent, daemon.dropped, daemon.core.counters.lost_samples) == (0, 0, 0)
    assert heard.rates == [f.payload for f in expected if f.frame_id == RATE.frame_id]
    assert heard.summaries == [f.payload for f in expected if f.frame_id == SUMMARY.frame_id]
    assert len(heard.summaries) == 2
