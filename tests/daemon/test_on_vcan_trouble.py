"""The daemon on real SocketCAN interfaces that carry less than is sent, go down or away, or are not there yet."""

import math
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can
import pytest

from observer_rt.config.bench import load_bench
from observer_rt.daemon.input_monitoring import input_watch
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.stream.state import Reason
from observer_rt.engine.words import Topic
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.replay.player import play
from tests.benches import block_bench
from tests.daemon.end_to_end import START_TIMEOUT, STATUS, command, decoded, results_of
from tests.daemon.participants import HeardDaemon, bench_file, opened, over_bus, serving, until
from tests.device import frames_of, worn_recording
from tests.interface import FRAME_BYTES, OwnInterface

BUS = 1000  # frames/s: fewer than the slowest machine sends
QUEUE = 20  # frames


@pytest.mark.vcan
def test_inputs_and_results_wait_for_one_full_queue(own_interface: OwnInterface, tmp_path: Path) -> None:
    """Replay sends as fast as it may: it and the daemon find the queue full, and share what leaves it."""
    own_interface.slow_down(BUS * FRAME_BYTES, QUEUE * FRAME_BYTES)
    path = bench_file(tmp_path, own_interface.name, "socketcan")
    recording = worn_recording(2)
    expected = evaluate(load_bench(path), [recording]).frames
    heard, daemon = over_bus(path, frames_of(path, recording))
    assert own_interface.refused > 0
    assert (daemon.unsent, daemon.dropped, daemon.core.counters.lost_samples) == (0, 0, 0)
    assert heard.results == results_of(expected)
    assert len(heard.summaries) == 2


BLOCK = 9  # samples of a SampleBlock
FIRST, LOST, LAST = 600, 200, 600  # frames before, during and after the outage


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
    own_interface: OwnInterface,
    tmp_path: Path,
    outage: Callable[[OwnInterface, Callable[[], None]], None],
    said: str,
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
    assert status["LinkTroubles"] == 1
    assert status["LostSamples"] == LOST * BLOCK
    assert status["DroppedFrames"] == 0


class HeldLearning(ThreadPoolExecutor):
    """Learns in a thread, which can be held."""

    def __init__(self) -> None:
        super().__init__(1)
        self.goes_on = threading.Event()
        self.goes_on.set()

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        def learned() -> Any:
            self.goes_on.wait()
            return fn(*args, **kwargs)

        return super().submit(learned)


@pytest.mark.slow
@pytest.mark.vcan
def test_learning_that_hangs_costs_nothing_that_was_learned(
    own_interface: OwnInterface, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rates go on and stay valid, the log says it; what it was learning from counts once it goes on.

    On a slow machine many events are not even examined in time.
    """
    monkeypatch.setattr(input_watch, "HUNG", 0.3)
    path = bench_file(tmp_path, own_interface.name, "socketcan")
    path.write_text(path.read_text().replace("lockstep = true", "lockstep = false"))
    recording = worn_recording(30)
    frames = frames_of(path, recording)
    learned = evaluate(load_bench(path), [recording]).knowledge
    learning = HeldLearning()
    with opened(path, sending=False) as [link], opened(path, sending=True) as [player]:
        daemon = HeardDaemon(path, link, knowledge=learned, learning=learning)

        def play_to_it(part: list[TimedFrame]) -> list[InjectionReport]:
            received, heard = daemon.core.counters.frames + len(part), len(daemon.notes.injections)
            play(part, player, 1.0)
            until(lambda: daemon.core.counters.frames == received)
            return daemon.notes.injections[heard:]

        def told() -> list[str]:
            return [notice.text for notice in daemon.notes.notices if notice.topic is Topic.LEARNING]

        third = len(frames) // 3
        with serving(daemon):
            until(daemon.ready.is_set)
            play_to_it(frames[:third])
            until(lambda: daemon.core.learning_from is None)
            learning.goes_on.clear()
            while_held = play_to_it(frames[third : 2 * third])
            adoptions = daemon.core.counters.adoptions
            assert "learning from an event has taken" in told()[-1]
            learning.goes_on.set()
            until(lambda: "learning goes on" in told())
            afterwards = play_to_it(frames[2 * third :])
            until(lambda: daemon.core.counters.adoptions > adoptions)
    assert len(while_held) >= 8
    assert any(report.valid for report in while_held)
    assert {report.reason for report in while_held[1:] + afterwards[1:]} <= {Reason.NONE, Reason.NOT_JUDGED}
    assert daemon.core.counters.lost_samples == daemon.dropped == 0


class Run:
    """A daemon process and its lines so far."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def until_told(self, text: str) -> str:
        """The first line with a text, waited for."""
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
def test_the_interface_is_waited_for_and_another_daemon_is_heard(
    own_interface: OwnInterface, tmp_path: Path
) -> None:
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
            first.until_told("WARNING sender: another node sends ObserverStatus 0x202: ")
            first.until_told("SECOND_SENDER: another node sends what only this observer should")
        first.until_told("INFO sender: the other sender is silent after")


@pytest.mark.vcan
def test_one_interface_of_several_goes_and_comes_back(
    tmp_path: Path, vcan: str, interfaces: list[OwnInterface]
) -> None:
    path = block_bench(tmp_path / "four", "socketcan", [vcan, *(each.name for each in interfaces)])
    frames = frames_of(path, worn_recording())
    first, during, last = frames[:600], frames[600:780], frames[780:]
    with opened(path, sending=False) as links, opened(path, sending=True) as players:
        daemon = HeardDaemon(path, *links)
        by_bus = dict(enumerate(players))
        with serving(daemon):
            until(daemon.ready.is_set)
            play(first, players[0], math.inf, by_bus=by_bus)
            until(lambda: daemon.core.counters.frames == len(first))
            interfaces[0].remove()
            until(lambda: any("there is no interface vcan1" in message for message in daemon.messages))
            others = [frame for frame in during if frame.bus != 1]
            play(others, players[0], math.inf, by_bus=by_bus)
            until(lambda: daemon.core.counters.frames == len(first) + len(others))
            interfaces[0].add()
            until(lambda: daemon.messages[-1] == "lift (vcan1) is back")
            players[1].reconnect()
            play(last, players[0], math.inf, by_bus=by_bus)
            until(lambda: daemon.core.counters.frames == len(frames) - len(during) + len(others))
    assert [port.outages for port in daemon.ports] == [0, 1, 0, 0]
    assert daemon.core.counters.lost_samples == 60 * 28
    assert daemon.dropped == 0
