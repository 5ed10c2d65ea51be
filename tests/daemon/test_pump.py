"""The pump on a pair of sockets that carries what a raw CAN socket does: same frames in, same frames out."""

import select
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from observer_rt.bus.links.descriptor import DescriptorLink
from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.config.bench import load_bench
from observer_rt.daemon.daemon import Daemon
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.engine.stream.state import Reason, State, VerdictKind
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.foundation.errors import RunError
from tests.benches import SAMPLE_RATE
from tests.daemon.end_to_end import RATE, SUMMARY, decoded, payloads, published_rates, results_of
from tests.daemon.participants import PumpRun, serving, until
from tests.daemon.slow_frames import bed, slow_bench
from tests.device import RATES, Device, encoded, frames_of, inserted, run, simulated, worn_recording
from tests.engine.service.test_surroundings import bench as temperature_bench
from tests.engine.service.test_surroundings import chamber, chamber_bench, sensor

FD_FRAME = struct.Struct("=IBB2x64s")
LITTLE_ROOM = 1 << 14  # bytes of a socket's queue, some twenty frames


class FarEnd:
    def __init__(self, end: socket.socket) -> None:
        self._end = end
        self.received: dict[int, list[bytes]] = {}

    def send(self, frames: Iterable[TimedFrame], listening: bool = True) -> None:
        for frame in frames:
            self._end.send(FD_FRAME.pack(frame.frame_id, len(frame.payload), 1, frame.payload))
            if listening:
                self.read()

    def has_room(self) -> bool:
        return bool(select.select([], [self._end], [], 0.0)[1])

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
def paired(bus: BusMap, room: int | None = None) -> Iterator[tuple[FarEnd, DescriptorLink]]:
    """A device, and our link to it; room: for what we send, in bytes, None: the usual."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    if room is not None:
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, room)
    with ours, theirs, DescriptorLink(str(ours.fileno()), True, None) as link:
        yield FarEnd(theirs), link


@contextmanager
def connected(path: Path) -> Iterator[tuple[FarEnd, Daemon]]:
    bench = load_bench(path)
    bus = map_bus(bench)
    with paired(bus) as (device, link):
        yield device, Daemon(bench, bus, [link])


@contextmanager
def pumped(path: Path, room: int | None = None, waits_for_verdicts: bool = True) -> Iterator[tuple[FarEnd, PumpRun]]:
    """A device, which has read all that was sent in the end, and a pump that serves it; room: as of `paired`."""
    with paired(map_bus(load_bench(path)), room) as (device, link):
        with PumpRun(path, link, waits_for_verdicts) as run:
            yield device, run
        device.read()


def test_while_another_node_sends_the_same_no_rate_is_valid(bench: Path, frames: list[TimedFrame]) -> None:
    """And nothing else of the frames differs, but for their protection."""
    history = payloads(evaluate(load_bench(bench), [worn_recording()]).frames, RATE)
    with connected(bench) as (device, daemon):
        with serving(daemon):
            device.send(frames[:-200])
            until(lambda: daemon.core.counters.frames == len(frames) - 200)
            device.send([encoded(RATE, bytes(64))])
            until(lambda: daemon.arrivals.foreign_frames == 1)
            until(lambda: daemon.state(time.monotonic_ns())[1] is Reason.SECOND_SENDER)
            time.sleep(0.1)
            device.read()
            before = len(device.received[RATE.frame_id])
            device.send(frames[-200:])
            until(lambda: daemon.core.counters.frames == len(frames))
        device.read()
    received = [decoded(RATE, payload) for payload in device.received[RATE.frame_id]]
    expected = [decoded(RATE, payload) for payload in history]
    assert any(each["Valid"] for each in expected[before:])
    marked, crc = {"Valid": 0.0, "State": float(State.DEGRADED)}, {"CRC": 0.0}
    assert len(received) == len(expected)
    assert [each | crc for each in received] == [
        *(each | crc for each in expected[:before]),
        *(each | marked | crc for each in expected[before:]),
    ]


def through_pump(path: Path, frames: Sequence[TimedFrame]) -> dict[int, list[bytes]]:
    out: list[OutputFrame] = []
    with pumped(path) as (device, run):
        for frame in frames:
            while not device.has_room():  # the loop may wait for a verdict
                out += run.pump.serve(1e-3)
            device.send([frame])
            out += run.pump.serve(0.0)
        out += run.serve_until_taken(len(frames))
        device.read()
        out += run.pump.finish()
    for frame_out in out:
        device.received.setdefault(frame_out.frame_id, []).append(frame_out.payload)
    return device.received


def warming_fuel(folder: Path) -> tuple[Path, list[TimedFrame]]:
    """Fuel that warms within events, is silent for longer than it counts, and is not known for a while."""
    frames = Device().send(simulated())
    quarter = len(frames) // 4
    values = [(0, 40.0), (7, 43.0), (quarter, 60.0), (quarter + 30, 85.0), (2 * quarter, None)]
    values += [(3 * quarter, 20.0)]
    values += [(number, 50.0 + number % 7) for number in range(3 * quarter + 20, len(frames), 11)]
    changes = [(number, sensor(celsius)) for number, celsius in values]
    return temperature_bench(folder, "timeout_ms = 60\n"), inserted(frames, changes)


def rising_pressure(folder: Path) -> tuple[Path, list[TimedFrame]]:
    """A pressure in the chamber that rises within the second injection, unlike what the model's file says."""
    frames = Device().send(simulated())
    at = [(7, chamber(2.0)), (int(0.2008 * SAMPLE_RATE) // 9, chamber(6.0))]
    return chamber_bench(folder).path, inserted(frames, at)


def switched_learning(folder: Path) -> tuple[Path, list[TimedFrame]]:
    """Learning that is held up from before the first injection until after it, and again for the last."""
    frames = Device().send(simulated())
    quarter = len(frames) // 4
    values = {5: 0, 2 * quarter: 1, 3 * quarter: 0}
    changes = [(number, bed("LearnEnable", value)) for number, value in values.items()]
    return slow_bench(folder, {"learning_enable": ("Bed", "LearnEnable")}), inserted(frames, changes)


@pytest.mark.parametrize("case", [warming_fuel, rising_pressure, switched_learning])
def test_optional_inputs_take_effect_where_they_do_without_a_pump(
    tmp_path: Path, case: Callable[[Path], tuple[Path, list[TimedFrame]]]
) -> None:
    path, frames = case(tmp_path)
    alone = run(path, frames)
    through = through_pump(path, frames)
    assert (through[RATE.frame_id], through[SUMMARY.frame_id]) == results_of(alone.frames)
    assert len(alone.reports) == 3


def in_time(frames: Iterable[TimedFrame]) -> Iterator[TimedFrame]:
    start = time.monotonic()
    for frame in frames:
        time.sleep(max(start + frame.time - time.monotonic(), 0.0))
        yield frame


def test_rates_need_no_attention(bench: Path) -> None:
    """They come while nothing of Python runs for the pump, which wakes once for several frames."""
    worn = worn_recording(2)
    frames = frames_of(bench, worn)
    with pumped(bench, waits_for_verdicts=False) as (device, run):
        device.send(in_time(frames))
        until(lambda: run.core.counters.frames == len(frames))
        assert run.pump._pump.memory[0]["turns"] < 0.7 * len(frames)
    observer = run.core.compiled.observer
    taken = int(observer.memory[0]["judgement"]["events_taken"])
    assert taken > 0
    assert (observer.events["taken"][:taken] == VerdictKind.NOTHING).all()
    _, count = published_rates(device.received[RATE.frame_id], worn.samples)
    assert (count[: run.core.processed - RATES] == 1).all()


def test_rates_that_wait_at_the_end_are_handed_over(bench: Path) -> None:
    """A device that reads nothing until the loop has ended: what found no room is the caller's to send."""
    worn, handed = worn_recording(2), list[OutputFrame]()
    with pumped(bench, LITTLE_ROOM) as (device, run):
        for frame in frames_of(bench, worn):
            while not device.has_room():
                handed += run.pump.serve(1e-3)
            device.send([frame], listening=False)
        while run.core.processed <= worn.samples - RATES:
            handed += run.pump.serve(1e-3)
        handed += run.pump.finish()
    rates, late = payloads(evaluate(load_bench(bench), [worn]).frames, RATE), payloads(handed, RATE)
    assert 0 < len(device.received[RATE.frame_id]) < len(rates) - 1
    assert device.received[RATE.frame_id] + late == rates
    assert not run.unsent


def test_it_ends_while_the_stream_waits_for_a_verdict(bench: Path) -> None:
    """Nobody gives one any more: the loop is not to wait for it."""
    with pumped(bench) as (device, run):
        waiting = run.core.compiled.observer.memory["judgement"]["waiting"]
        for frame in frames_of(bench, worn_recording(2)):
            until(lambda: waiting[0] or device.has_room())
            if waiting[0]:
                break
            device.send([frame])
        assert waiting[0]
        assert run.ends()


def test_a_device_that_goes_away_is_said(bench: Path) -> None:
    with connected(bench) as (device, daemon):
        device.close()
        with pytest.raises(RunError, match="closed"):
            daemon.run(threading.Event())
