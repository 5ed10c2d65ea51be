"""The daemon on real SocketCAN interfaces that carry less than is sent, go down or away, or are not there yet."""

import math
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest

from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.replay.player import play
from tests.daemon.end_to_end import START_TIMEOUT, STATUS, command, decoded
from tests.daemon.participants import HeardDaemon, bench_file, opened, serving, until
from tests.daemon.test_daemon_link import BLOCK, FIRST, LAST, LOST
from tests.device import frames_of, worn_recording
from tests.interface import OwnInterface


def taken_down(interface: OwnInterface, until_noticed: Callable[[], None]) -> None:
    interface.down()
    until_noticed()
    interface.up()


def unplugged(interface: OwnInterface, until_noticed: Callable[[], None]) -> None:
    interface.remove()
    until_noticed()
    interface.add()


@pytest.mark.slow
@pytest.mark.vcan
@pytest.mark.parametrize(
    ("outage", "said"), [(taken_down, "vcan9 is down"), (unplugged, "there is no interface vcan9")]
)
def test_the_daemon_stays_and_goes_on(
    own_interface: OwnInterface, tmp_path: Path, outage: Callable[[OwnInterface, Callable[[], None]], None], said: str
) -> None:
    name = own_interface.name
    path = bench_file(tmp_path, name, "socketcan")
    frames = frames_of(path, worn_recording())
    with opened(path, sending=False) as [link], opened(path, sending=True) as [player]:
        daemon = HeardDaemon(path, link)

        def play_to_it(part: list[TimedFrame]) -> None:
            received = daemon.core.counters.frames + len(part)
            play(part, player, math.inf)
            until(lambda: daemon.core.counters.frames == received)

        with serving(daemon):
            until(daemon.ready.is_set)
            play_to_it(frames[:FIRST])
            outage(own_interface, lambda: until(lambda: any(said in message for message in daemon.messages)))
            until(lambda: daemon.messages[-1] == f"{name} is back")
            with can.Bus(interface="socketcan", channel=name, fd=True) as listener:
                player.reconnect()
                play_to_it(frames[FIRST + LOST : FIRST + LOST + LAST])
                listener.set_filters([{"can_id": STATUS.frame_id, "can_mask": 0x7FF}])
                status = None
                while status is None or status["SamplesProcessed"] < (FIRST + LAST - 1) * BLOCK:
                    message = listener.recv(5.0)
                    assert message is not None
                    if message.arbitration_id == STATUS.frame_id:
                        status = decoded(STATUS, bytes(message.data))
    assert (status["LinkTroubles"], status["LostSamples"]) == (1, LOST * BLOCK)
    assert status["DroppedFrames"] == 0


class Run:
    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def until_told(self, text: str) -> str:
        end = time.monotonic() + START_TIMEOUT
        while True:
            for line in self.lines:
                if text in line:
                    return line
            assert self.process.poll() is None, self.lines
            assert time.monotonic() < end, self.lines
            time.sleep(0.05)

    def stop(self) -> int:
        self.process.send_signal(signal.SIGTERM)
        self._reader.join(START_TIMEOUT)
        return self.process.wait(START_TIMEOUT)

    def _read(self) -> None:
        assert self.process.stderr is not None
        self.lines.extend(self.process.stderr)


@contextmanager
def running(bench: Path) -> Iterator[Run]:
    process = subprocess.Popen(command("run", "--bench", bench), stderr=subprocess.PIPE, text=True)
    try:
        run = Run(process)
        yield run
        assert run.stop() == 0, run.lines
    finally:
        process.kill()


@pytest.mark.slow
@pytest.mark.vcan
def test_the_interface_is_waited_for_and_another_daemon_is_heard(own_interface: OwnInterface, tmp_path: Path) -> None:
    bench = bench_file(tmp_path, own_interface.name, "socketcan")
    own_interface.remove()
    with running(bench) as first:
        waiting = first.until_told("waiting for the interface")
        assert "WARNING link: waiting for the interface: there is no interface vcan9" in waiting
        own_interface.add()
        first.until_told("INFO link: vcan9 is there")
        first.until_told("INFO start: ready")
        with running(bench) as second:
            second.until_told("WARNING sender: another node sends ObserverStatus 0x202 already")
            first.until_told("WARNING sender: another node sends ObserverStatus 0x202; remedy")
            first.until_told("SECOND_SENDER: another node sends what only this observer should")
        first.until_told("INFO sender: the other sender is silent after")
