"""The compiled pump on a pair of sockets that carries what a raw CAN socket does: same frames in, same frames out."""

import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from observer_rt.bus.links.descriptor import DescriptorLink
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.evaluation.evaluate import evaluate
from observer_rt.foundation.errors import RunError
from observer_rt.observer.stream.verdict import Taken
from observer_rt.recording.replay.framing import Framer, TimedFrame, whole
from observer_rt.service.core.core import Core
from observer_rt.service.daemon import Daemon
from observer_rt.service.pump.compiled_pump import CompiledPump
from observer_rt.service.watch.arrivals import Arrivals
from tests.service.end_to_end import RATE, STATUS, SUMMARY, decoded, published_rates
from tests.service.participants import bench_file, serving, until, worn_recording

BLOCK = 9  # samples of a frame
FD_FRAME = struct.Struct("=IBB2x64s")


class Device:
    """The other end: sends frames, and keeps what comes back."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end
        self.received: dict[int, list[bytes]] = {}

    def send(self, frames: list[TimedFrame]) -> None:
        for frame in frames:
            self._end.send(FD_FRAME.pack(frame.frame_id, len(frame.payload), 1, frame.payload))
            self.read()

    def close(self) -> None:
        self._end.close()

    def read(self) -> None:
        while True:
            try:
                identifier, length, _, data = FD_FRAME.unpack(self._end.recv(80, socket.MSG_DONTWAIT))
            except BlockingIOError:
                return
            self.received.setdefault(identifier, []).append(data[:length])


@contextmanager
def connected(path: Path) -> Iterator[tuple[Device, Daemon]]:
    """A device, and a daemon that serves it."""
    bench = load_bench(path)
    bus = map_bus(bench)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    wanted = bus.received_on(0)
    with ours, theirs, DescriptorLink(str(ours.fileno()), True, wanted) as link:
        yield Device(theirs), Daemon(bench, bus, [link])


def test_same_frames_as_evaluate(tmp_path: Path) -> None:
    """Bit for bit, learning included: a loop in compiled code, and everything in one thread without a bus."""
    path = bench_file(tmp_path, "0")
    recording = worn_recording()
    frames = list(Framer(map_bus(load_bench(path))).frames(recording, whole(recording)))
    history = evaluate(load_bench(path), [recording])
    with connected(path) as (device, daemon):
        with serving(daemon):
            device.send(frames)
            until(lambda: daemon.core.counters.frames == len(frames))
        device.read()
    for message in (RATE, SUMMARY):
        expected = [frame.payload for frame in history.frames if frame.frame_id == message.frame_id]
        assert device.received[message.frame_id] == expected
    last = decoded(STATUS, device.received[STATUS.frame_id][-1])
    assert last["SamplesProcessed"] == recording.samples
    assert last["DroppedFrames"] == last["LateAdoptions"] == 0
    assert daemon.core.counters.adoptions >= 2


def test_rates_need_no_attention(tmp_path: Path) -> None:
    """Rates come while nothing of Python runs for the pump, which does not wait for verdicts nobody posts."""
    path = bench_file(tmp_path, "0")
    recording = worn_recording(2)
    bench = load_bench(path)
    bus = map_bus(bench)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs, DescriptorLink(str(ours.fileno()), True, bus.received_on(0)) as link:
        device = Device(theirs)
        core = Core(bench.injector, bus)
        core.compiled.observer.memory["waits_for_verdicts"] = False
        pump = CompiledPump([link], core, bus, Arrivals(bus))
        try:
            frames = list(Framer(bus).frames(recording, whole(recording)))
            device.send(frames)
            until(lambda: core.counters.frames == len(frames))
            device.read()
        finally:
            pump.close()
        device.read()
        memory = core.compiled.observer.memory[0]
        assert memory["events_taken"] > 0
        assert (memory["events"]["taken"][: int(memory["events_taken"])] == Taken.NOTHING).all()
    _, count = published_rates(device.received[RATE.frame_id], recording.samples)
    assert (count[: core.processed // BLOCK * BLOCK] == 1).all()


def test_a_device_that_goes_away_is_said(tmp_path: Path) -> None:
    with connected(bench_file(tmp_path, "0")) as (device, daemon):
        device.close()
        with pytest.raises(RunError, match="closed"):
            daemon.run(threading.Event())
