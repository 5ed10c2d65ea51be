"""Recordings as frames, whole and windowed; decoded by plain cantools."""

import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.config.bench import load_bench
from observer_rt.config.signals import Role
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.replay.recording_frames import Device, recording_frames
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.foundation.errors import UserError
from tests.benches import THREE_MESSAGES, sample_bench
from tests.files.replay.decoded import DATABASE, decoded
from tests.files.signals.generated import RepeatedRecording

RATE = 100e3


@pytest.fixture(scope="module")
def bus() -> BusMap:
    return map_bus(load_bench())


def recording_of(samples: int, open_at: tuple[int, ...] = ()) -> Recording:
    lift = np.zeros(samples)
    for sample in open_at:
        lift[sample : sample + 100] = 1e-4
    random = np.random.default_rng(samples)
    return Recording(
        np.arange(samples) / RATE,
        random.uniform(0, 200e6, samples),
        lift,
        random.uniform(0, 200e6, samples),
        path=Path("recorded.csv"),
    )


def sent(recording: Recording, bus: BusMap, windowed: bool = False) -> list[TimedFrame]:
    return list(recording_frames(HeldSignals(recording), bus, windowed))


def rail_by_index(frames: list[TimedFrame]) -> dict[int, float]:
    """Rail pressure [MPa] by sample index; every index may come once, missing values are left out."""
    return {index: value / 1e6 for index, value in decoded(frames)[0].items() if not np.isnan(value)}


def test_a_long_recording_is_sent_as_if_encoded_at_once(bus: BusMap) -> None:
    recording = recording_of(5003, open_at=(100,))
    frames = sent(recording, bus)
    assert len(frames) == 556
    assert {(frame.frame_id, frame.is_extended, frame.is_fd) for frame in frames} == {(0x100, False, True)}
    signals = recording.rail_pressure, recording.needle_lift, recording.line_pressure
    for values, signal, half_a_step in zip(decoded(frames).values(), signals, (2501.0, 5.01e-9, 2501.0), strict=True):
        assert list(values) == list(range(5004))
        assert list(values.values())[:5003] == pytest.approx(signal.tolist(), abs=half_a_step)
    assert [frame.payload[2] for frame in frames] == [n & 0xFF for n in range(556)]
    assert [frame.time for frame in frames] == pytest.approx([(9 * n + 8) / RATE for n in range(556)])


def test_windows_hold_whole_frames_round_the_injections(bus: BusMap) -> None:
    recording = recording_of(20_000, open_at=(5000, 9000, 19_900))
    frames = sent(recording, bus, windowed=True)
    values = rail_by_index(frames)
    rail = recording.rail_pressure / 1e6
    assert list(values.values()) == pytest.approx([rail[index] for index in values], abs=0.0026)
    for opening in (5000, 9000):
        near = [index for index in values if opening - 1000 <= index <= opening + 1000]
        assert (near, len(near) % 9) == (list(range(opening - 200, opening - 200 + len(near))), 0)
        assert 100 + 600 <= len(near) <= 100 + 600 + 9
    assert max(values) == 19_999
    times = [last / RATE for last in [*values][8::9]]  # but of the last one, which is not filled
    assert [frame.time for frame in frames[:-1]] == pytest.approx(times[: len(frames) - 1])
    assert [frame.payload[2] for frame in frames] == [n & 0xFF for n in range(len(frames))]


def test_a_device_stamps_frames_later_than_their_last_sample_by_the_delay(tmp_path: Path) -> None:
    """Each message by its own, from its last sample on, as `delay_us` of a bench says."""
    bench, delays = load_bench(sample_bench(tmp_path, THREE_MESSAGES, rate=RATE)), (0.0, 150.0, 40.0)
    signals = bench.injector.config.signals
    changed = {
        role.value: signals.of(role).model_copy(update={"delay_us": delay, "time_base": role.value})
        for role, delay in zip(Role, delays, strict=True)
    }
    device = Device(map_bus(bench.with_sections(signals=signals.model_copy(update=changed))))
    for _ in range(2):
        device.begin(RATE)
        (chunk,) = device.chunks(HeldSignals(recording_of(28 * 20)).chunks())
        frames = [frame for _, frame in device.frames(chunk)]
        assert len(frames) == 60
        for frame in frames:
            values = DATABASE.decode_message(frame.frame_id, frame.payload, decode_choices=False)
            delay = delays[(0x110, 0x111, 0x112).index(frame.frame_id)]
            assert frame.stamp_ns == pytest.approx((values["SampleIndex"] + 27) / RATE * 1e9 + 1e3 * delay, abs=1)


@given(gap=st.integers(590, 640))
def test_windows_that_nearly_touch_send_no_index_twice(bus: BusMap, gap: int) -> None:
    values = rail_by_index(sent(recording_of(3000, open_at=(500, 600 + gap)), bus, windowed=True))
    assert set(values) >= {*range(300, 999), *range(400 + gap, 1099 + gap)}


def test_windows_without_an_injection(bus: BusMap) -> None:
    with pytest.raises(UserError, match=r"--windowed: no injection in recorded\.csv"):
        sent(recording_of(1000), bus, windowed=True)


def test_a_recording_split_into_stretches_is_sent_as_on_one_grid(bus: BusMap) -> None:
    split = RepeatedRecording(recording_of(5003, open_at=(200, 4950)), 4, 2)
    for windowed in (False, True):
        assert list(recording_frames(split, bus, windowed)) == sent(split.collected(), bus, windowed)


def test_encoding_takes_a_small_part_of_the_time_that_a_recording_lasts(bus: BusMap) -> None:
    recording, begun = recording_of(100_000), time.process_time()
    sent(recording, bus)
    assert time.process_time() - begun < 0.15 * recording.samples / RATE


@pytest.mark.parametrize("windowed", [False, True])
def test_memory_does_not_depend_on_the_length(bus: BusMap, windowed: bool) -> None:
    """When the last frame is sent, the samples before it have been read and forgotten."""

    def peak(times: int) -> int:
        long = RepeatedRecording(recording_of(10_000, open_at=(500,)), times)
        tracemalloc.start()
        for _ in recording_frames(long, bus, windowed):
            pass
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    peak(3)
    assert peak(20) < 1.1 * peak(3)
