"""Recordings as frames: parts, windows, loops; decoded by plain cantools."""

import math
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.config.bench import load_bench
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.replay.recording_frames import RecordingPart
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.foundation.errors import UserError
from tests.files.replay.decoded import decoded
from tests.files.signals.generated import RepeatedRecording

RATE = 100e3


@pytest.fixture(scope="module")
def bus() -> BusMap:
    return map_bus(load_bench())


def recording_of(samples: int, open_at: tuple[int, ...] = (), start: float = 0.0) -> Recording:
    lift = np.zeros(samples)
    for sample in open_at:
        lift[sample : sample + 100] = 1e-4
    random = np.random.default_rng(samples)
    return Recording(
        start + np.arange(samples) / RATE,
        random.uniform(0, 200e6, samples),
        lift,
        random.uniform(0, 200e6, samples),
        path=Path("recorded.csv"),
    )


def part_of(
    recording: Recording, bus: BusMap, windowed: bool, start: float | None = None, stop: float | None = None
) -> RecordingPart:
    return RecordingPart(HeldSignals(recording), bus, windowed, start, stop)


def rail_by_index(frames: list[TimedFrame]) -> dict[int, float]:
    """Rail pressure [MPa] by sample index; every index may come once, missing values are left out."""
    return {index: value / 1e6 for index, value in decoded(frames)[0].items() if not np.isnan(value)}


def rail_of(recording: Recording) -> list[float]:
    return [pressure / 1e6 for pressure in recording.rail_pressure]


def test_a_long_recording_is_sent_as_if_encoded_at_once(bus: BusMap) -> None:
    """Each frame with its last sample."""
    recording = recording_of(5003, open_at=(100,))
    frames = list(part_of(recording, bus, False).frames())
    assert len(frames) == 556 == part_of(recording, bus, False).extent.frames
    assert {(frame.frame_id, frame.is_extended, frame.is_fd) for frame in frames} == {(0x100, False, True)}
    signals = recording.rail_pressure, recording.needle_lift, recording.line_pressure
    for values, sent, half_a_step in zip(
        decoded(frames).values(), signals, (2501.0, 5.01e-9, 2501.0), strict=True
    ):
        assert list(values) == list(range(5004))
        assert list(values.values())[:5003] == pytest.approx(sent.tolist(), abs=half_a_step)
    assert [frame.payload[2] for frame in frames] == [n & 0xFF for n in range(556)]
    assert [frame.time for frame in frames] == pytest.approx([(9 * n + 8) / RATE for n in range(556)])


def test_time_index_and_counter_go_on_over_loops(bus: BusMap) -> None:
    recording = recording_of(905)  # 100 frames of 9 samples, and 5 that fill none
    frames = list(part_of(recording, bus, False).frames(loop=3))
    assert len(frames) == 100 + 100 + 101
    values = rail_by_index(frames)
    rail = rail_of(recording)
    assert list(values) == list(range(900 + 900 + 905))
    assert list(values.values()) == pytest.approx([*rail[:900], *rail[:900], *rail], abs=0.0026)
    assert [frame.payload[2] for frame in frames] == [n & 0xFF for n in range(301)]
    assert [frame.time for frame in frames] == pytest.approx([(9 * n + 8) / RATE for n in range(301)])
    endless = part_of(recording, bus, False).frames(loop=0)
    assert [next(endless).payload for _ in range(300)] == [frame.payload for frame in frames[:300]]


def test_windows_hold_whole_frames_round_the_injections(bus: BusMap) -> None:
    recording = recording_of(20_000, open_at=(5000, 9000, 19_900))
    frames = list(part_of(recording, bus, True).frames())
    values = rail_by_index(frames)
    rail = rail_of(recording)
    assert list(values.values()) == pytest.approx([rail[index] for index in values], abs=0.0026)
    for opening in (5000, 9000):
        sent = [index for index in values if opening - 1000 <= index <= opening + 1000]
        assert sent == list(range(opening - 200, opening - 200 + len(sent)))
        assert len(sent) % 9 == 0
        assert 100 + 600 <= len(sent) <= 100 + 600 + 9
    assert max(values) == 19_999
    extent = part_of(recording, bus, True).extent
    assert extent.frames == len(frames)
    assert extent.duration == pytest.approx(0.2)
    assert [frame.payload[2] for frame in frames] == [n & 0xFF for n in range(len(frames))]


@given(gap=st.integers(590, 640))
def test_windows_that_nearly_touch_send_no_index_twice(bus: BusMap, gap: int) -> None:
    recording = recording_of(3000, open_at=(500, 600 + gap))
    values = rail_by_index(list(part_of(recording, bus, True).frames()))
    assert set(values) >= {*range(300, 999), *range(400 + gap, 1099 + gap)}


def test_windows_without_an_injection(bus: BusMap) -> None:
    with pytest.raises(UserError, match=r"--windowed: no injection in .* recorded\.csv"):
        part_of(recording_of(1000), bus, True).frames()


@pytest.mark.parametrize(
    ("start", "stop", "first", "last"),
    [
        (2.0, None, 0, 1000),
        (2.0012, None, 120, 1000),
        (None, 2.0012, 0, 120),
        (2.001, 2.004, 100, 400),
        (2.001001, 2.004001, 101, 401),
        (-5.0, math.inf, 0, 1000),
    ],
)
def test_a_part_in_the_recordings_own_time(
    bus: BusMap, start: float | None, stop: float | None, first: int, last: int
) -> None:
    recording = recording_of(1000, start=2.0)
    frames = list(part_of(recording, bus, False, start=start, stop=stop).frames())
    values = rail_by_index(frames)
    assert list(values.values()) == pytest.approx(rail_of(recording)[first:last], abs=0.0026)
    assert frames[0].time == pytest.approx(8 / RATE)
    assert part_of(recording, bus, False, start, stop).extent.duration == pytest.approx((last - first) / RATE)


def test_a_short_part_keeps_the_rate_of_the_whole(bus: BusMap) -> None:
    """48 kHz in printed microseconds: three stamps alone would not tell the rate."""
    time_s = np.round(np.arange(3000) / 48e3, 6)
    recording = replace(recording_of(3000), time=time_s)
    frames = part_of(recording, bus, False, start=0.05, stop=0.05006).frames()
    assert next(frames).time == pytest.approx(8 / 48e3, rel=1e-12)


@pytest.mark.parametrize(
    ("start", "stop"),
    [(3.0, None), (None, 2.0), (2.5, 2.5), (2.006, 2.004), (math.nan, None), (2.00999, None)],
)
def test_an_empty_part(bus: BusMap, start: float | None, stop: float | None) -> None:
    with pytest.raises(UserError, match="--start, --stop"):
        part_of(recording_of(1000, start=2.0), bus, False, start=start, stop=stop).frames()


def test_a_recording_split_into_stretches_is_sent_as_on_one_grid(bus: BusMap) -> None:
    split = RepeatedRecording(recording_of(5003, open_at=(200, 4950)), 4, 2)
    for windowed in (False, True):
        for start, stop in ((None, None), (0.03, 1.25)):
            result = RecordingPart(split, bus, windowed, start, stop).frames(loop=2)
            expected = part_of(split.collected(), bus, windowed, start, stop).frames(loop=2)
            assert list(result) == list(expected)


@pytest.mark.parametrize("windowed", [False, True])
def test_memory_does_not_depend_on_the_length(bus: BusMap, windowed: bool) -> None:
    """When the last frame is sent, the samples before it have been read and forgotten."""

    def peak(times: int) -> int:
        long = RepeatedRecording(recording_of(10_000, open_at=(500,)), times)
        tracemalloc.start()
        frames = RecordingPart(long, bus, windowed, start=0.1 * (times - 1)).frames()
        assert sum(1 for _ in frames) in ((1112,) if not windowed else range(60, 100))
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    peak(3)
    assert peak(300) < 1.1 * peak(30)
