"""Replay: the frames sent, their order and times; never how fast this machine is."""

import math
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.console import Console

from observer_rt.bus.links.link import Frame, LinkDownError
from observer_rt.bus.mapping.bus_map import map_bench
from observer_rt.config.bench import load_bench
from observer_rt.files.replay import player
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.replay.player import log_source, play
from observer_rt.foundation.errors import RunError
from tests.links import FakeLink


class Sink(FakeLink):
    def __init__(self) -> None:
        super().__init__()
        self.stamps: list[float] = []

    def on_sent(self, frame: Frame) -> None:
        self.stamps.append(time.monotonic())
        super().on_sent(frame)


def at(*times: float) -> list[TimedFrame]:
    return [TimedFrame(moment, n, False, True, bytes([n])) for n, moment in enumerate(times)]


def test_no_frame_is_sent_before_its_time() -> None:
    sink = Sink()
    before = time.monotonic()
    statistics = play(at(0.0, 0.005, 0.0055, 0.03, 0.03), sink, 0.5)
    assert [frame.frame_id for frame in sink.sent] == [0, 1, 2, 3, 4]
    for stamp, due in zip(sink.stamps, (0.0, 0.01, 0.011, 0.06, 0.06), strict=True):
        assert stamp - before >= due
    assert statistics.frames == 5
    assert statistics.duration >= 0.06
    assert statistics.latest >= 0.0
    assert statistics.as_text().startswith(f"5 frames in {statistics.duration:.3f} s")
    document = statistics.as_json()
    assert (document["frames"], document["lateness_max_s"]) == (5, statistics.latest)


def test_a_frame_is_sent_at_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock that only sleeping moves on: no sleep is longer than the frame has left."""
    now = 0

    def sleep(seconds: float) -> None:
        nonlocal now
        now += round(seconds * 1e9)

    class Stop(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            sleep(timeout or 0.0)
            return False

    monkeypatch.setattr(player, "time", SimpleNamespace(monotonic_ns=lambda: now, sleep=sleep))
    statistics = play(at(0.0, 0.0005, 0.02, 0.5), Sink(), 1.0, stop=Stop())
    assert statistics.latest < 1e-8
    assert statistics.duration == pytest.approx(0.5)


def test_results_beside_the_inputs_are_not_sent_again(tmp_path: Path) -> None:
    bench, path = load_bench(), tmp_path / "bus.log"
    mapped = map_bench(bench)
    inputs, results = mapped.injectors[0].input_layouts, mapped.sent
    sent = [layout.frame_id for layout in [*results, *inputs]]
    path.write_text("".join(f"({number}.0) can0 {each:03X}##100\n" for number, each in enumerate(sent)))
    source = log_source(bench, path, (), Console(quiet=True))
    assert [frame.frame_id for frame in source.frames] == [layout.frame_id for layout in inputs]


def test_a_delay_is_caught_up_and_counted() -> None:
    """The grid is absolute: a source that stalls makes its frames late, not those after them."""

    def stalling() -> Iterator[TimedFrame]:
        frames = at(0.0, 0.001, 0.002, 0.5)
        yield frames[0]
        time.sleep(0.05)
        yield from frames[1:]

    sink = Sink()
    statistics = play(stalling(), sink, 1.0)
    assert sink.stamps[3] - sink.stamps[0] >= 0.5 - 0.05  # not pushed back; nor early
    assert statistics.latest >= 0.048
    assert statistics.late >= 2


def test_without_a_grid_nothing_is_late() -> None:
    sink = Sink()
    statistics = play(at(0.0, 1e6), sink, math.inf)
    assert len(sink.sent) == 2
    assert math.isnan(statistics.latest)
    assert statistics.as_json()["lateness_max_s"] is None
    assert "late" not in statistics.as_text()


def test_stop_ends_a_long_wait() -> None:
    class Stopping(Sink):
        def on_sent(self, frame: Frame) -> None:
            super().on_sent(frame)
            threading.Timer(0.05, stop.set).start()

    stop = threading.Event()
    statistics = play(at(0.0, 3600.0), Stopping(), 1.0, stop=stop)
    assert statistics.frames == 1
    assert statistics.duration < 600


def test_progress_rises_with_the_time_of_the_recording() -> None:
    progress: list[float] = []
    play(at(0.0, 3.0), Sink(), 10.0, progress.append)
    assert len(progress) >= 3  # also while it waits
    assert progress == sorted(progress)
    assert 0.0 <= progress[0] <= progress[-1] <= 3.0


def test_a_failing_link_ends_the_replay() -> None:
    class BrokenSink(Sink):
        def on_sent(self, frame: Frame) -> None:
            raise RunError("the interface went away")

    with pytest.raises(RunError, match="went away"):
        play(at(0.0), BrokenSink(), 1.0)


class LooseSink(Sink):
    """Is away from the third frame on, until it was reconnected twice in vain."""

    def __init__(self) -> None:
        super().__init__()
        self.tries = 0

    def on_sent(self, frame: Frame) -> None:
        if len(self.sent) == 2 and self.tries < 3:
            raise LinkDownError("vcan9 is down\n  remedy: up")
        super().on_sent(frame)

    def reconnect(self) -> None:
        self.tries += 1
        if self.tries < 3:
            raise LinkDownError("vcan9 is down")


def test_an_interface_that_drops_is_waited_for_and_no_frame_is_left_out() -> None:
    sink, messages = LooseSink(), list[str]()
    statistics = play(at(0.0, 0.01, 0.02, 0.32), sink, 1.0, tell=messages.append)
    assert [frame.frame_id for frame in sink.sent] == [0, 1, 2, 3]
    assert messages == ["waiting for the interface: vcan9 is down\n  remedy: up", "the interface is back, going on"]
    assert 0.25 < statistics.paused < statistics.duration
    assert sink.stamps[3] - sink.stamps[2] >= 0.2  # the grid goes on as much later
    assert "without the interface" in statistics.as_text()
    assert statistics.as_json()["paused_s"] == statistics.paused


def test_waiting_can_be_stopped() -> None:
    sink, stop = LooseSink(), threading.Event()
    sink.tries = -(1 << 30)
    threading.Timer(0.3, stop.set).start()
    assert play(at(0.0, 0.01, 0.02), sink, 1.0, stop=stop).frames == 2
