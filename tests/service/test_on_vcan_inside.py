"""The daemon on a real SocketCAN interface, with all participants in one process: cheaper than three."""

from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import load_bench
from observer_rt.evaluation.evaluate import evaluate
from observer_rt.recording.replay.framing import Span, TimedFrame, whole, windows
from observer_rt.recording.signals.recording import Recording
from tests.device import frames_of, worn_recording
from tests.service.end_to_end import RATE, SUMMARY, published_rates
from tests.service.participants import bench_file, over_bus

SPEED = 0.1
BLOCK = 9  # samples of a SampleBlock


@pytest.fixture(scope="module")
def recording() -> Recording:
    return worn_recording(injections=3)


@pytest.fixture
def bench(tmp_path: Path, vcan: str) -> Path:
    return bench_file(tmp_path, vcan, "socketcan")


def framed(bench: Path, recording: Recording, spans: list[Span]) -> list[TimedFrame]:
    return frames_of(bench, recording, spans)


@pytest.mark.vcan
def test_evaluate_the_bus_of_a_process_and_vcan_give_the_same_frames(
    bench: Path, recording: Recording, tmp_path: Path
) -> None:
    frames = framed(bench, recording, whole(recording))
    on_vcan, daemon = over_bus(bench, frames, SPEED)
    inside, _ = over_bus(bench_file(tmp_path, "in-process"), frames)
    expected = evaluate(load_bench(bench), [recording]).frames
    assert daemon.core.counters.adoptions >= 1
    assert on_vcan.rates == inside.rates == [f.payload for f in expected if f.frame_id == RATE.frame_id]
    assert len(on_vcan.summaries) == 3
    assert (
        on_vcan.summaries
        == inside.summaries
        == [f.payload for f in expected if f.frame_id == SUMMARY.frame_id]
    )


@pytest.mark.vcan
def test_windowed_source_every_index_sent_once(bench: Path, recording: Recording) -> None:
    spans = windows(recording)
    heard, daemon = over_bus(bench, framed(bench, recording, spans), SPEED)
    _, count = published_rates(heard.rates, recording.samples)
    assert count.max() == 1
    assert all((count[span.start : span.end] == 1).all() for span in spans)
    assert len(heard.summaries) == len(spans) == 3
    assert daemon.core.counters.lost_samples == 0


@pytest.mark.vcan
def test_lost_frame_is_not_available_and_counted(bench: Path, recording: Recording) -> None:
    frames = framed(bench, recording, whole(recording))
    gone = 200
    heard, _ = over_bus(bench, frames[:gone] + frames[gone + 1 : 600], SPEED)
    rate, count = published_rates(heard.rates, 600 * BLOCK)
    assert count.max() == 1
    assert np.isnan(rate[gone * BLOCK : (gone + 1) * BLOCK]).all()
    assert not np.isnan(rate[gone * BLOCK - 1])
    assert not np.isnan(rate[(gone + 50) * BLOCK])
    assert heard.last_status()["LostSamples"] == BLOCK
