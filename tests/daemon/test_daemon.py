"""The daemon on the bus of this process: what it publishes, what it says of itself, and whether it is alive."""

import math
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from observer_rt.bus.links.link import Frame
from observer_rt.bus.mapping.bus_map import layout_of, map_bus, stream_of
from observer_rt.config.bench import load_bench
from observer_rt.config.signals import Role
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.words import Topic
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.foundation.errors import RunError
from tests.benches import THREE_MESSAGES
from tests.daemon.end_to_end import published_rates, results_of
from tests.daemon.participants import HeardDaemon, ScriptedLink, bench_file, over_bus, serving, until
from tests.daemon.pulses import EnergizingBy, injected, misfired, on_change, pulse_bench, samples
from tests.device import frames_of, merged, worn_recording


@pytest.fixture(params=["virtual", pytest.param("socketcan", marks=pytest.mark.vcan)])
def bus(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, float]:
    if request.param == "virtual":
        return bench_file(tmp_path, "daemon-test"), math.inf
    return bench_file(tmp_path, request.getfixturevalue("vcan"), "socketcan"), 0.1


def test_frames_equal_those_of_evaluate(bus: tuple[Path, float]) -> None:
    """Bit for bit: a worker thread over a bus, and everything in one thread without a bus; learning included."""
    bench, speed = bus
    recording = worn_recording()
    results, daemon = over_bus(bench, frames_of(bench, recording), speed)
    assert results.results == results_of(evaluate(load_bench(bench), [recording]).frames)
    assert len(results.summaries) == 4
    assert daemon.core.counters.adoptions >= 2
    _, count = published_rates(results.rates, recording.samples)
    assert (count == 1).all()
    last = results.last_status()
    assert last["SamplesProcessed"] == recording.samples
    assert (last["Adoptions"], last["State"]) == (daemon.core.counters.adoptions, State.ADAPTED)
    assert last["LostSamples"] == last["DroppedFrames"] == last["LateAdoptions"] == 0


def test_states_before_frames_between_and_after(bench: Path, frames: list[TimedFrame]) -> None:
    link, waiting = ScriptedLink(frames), ScriptedLink()
    with serving(HeardDaemon(bench, waiting)):
        until(lambda: len(waiting.statuses()) >= 2)
    for status in waiting.statuses():
        assert (status["State"], status["Reason"]) == (State.WAITING_FOR_DATA, Reason.STARTING)
        assert status["Valid"] == 0
    daemon = HeardDaemon(bench, link)
    with serving(daemon):
        until(lambda: daemon.now() == (State.ADAPTED, Reason.NONE))
        until(lambda: link.statuses()[-1]["Reason"] == Reason.INPUT_TIMEOUT)
        assert (link.statuses()[-1]["State"], link.statuses()[-1]["Valid"]) == (State.WAITING_FOR_DATA, 0)


def test_status_comes_in_its_period(bench: Path) -> None:
    link = ScriptedLink()
    with serving(HeardDaemon(bench, link)):
        time.sleep(1.0)
    assert 5 <= len(link.statuses()) <= 12  # every 100 ms if the machine lets it, and the last


def test_failing_link_ends_the_loop(bench: Path, frames: list[TimedFrame]) -> None:
    others = set(threading.enumerate())
    daemon = HeardDaemon(bench, ScriptedLink(frames, RunError("the interface went away")))
    with pytest.raises(RunError, match="the interface went away"):
        daemon.run(threading.Event())
    assert daemon.core.knowledge.state.events >= 3
    assert daemon.core.knowledge.phi_version >= 2
    left = set(threading.enumerate()) - others
    assert "learning" not in [thread.name.split("_")[0] for thread in left]


def test_writes_that_failed_are_counted_in_the_status(bench: Path, frames: list[TimedFrame]) -> None:
    """Of those who write files beside the loop; the count stays at its largest value."""
    for failed, shown in ((3, 3), (100_000, 65535)):
        link = ScriptedLink(frames[:10])
        with serving(HeardDaemon(bench, link, failed_writes=lambda: failed)):  # noqa: B023
            until(link.empty.is_set)
        assert link.statuses()[-1]["FailedWrites"] == shown


class HangingLink(ScriptedLink):
    def __init__(self) -> None:
        super().__init__()
        self.may_return = threading.Event()
        self.may_return.set()

    def receive(self, timeout_s: float) -> Frame | None:
        self.may_return.wait()
        return super().receive(timeout_s)


def test_a_loop_that_hangs_is_not_alive(bench: Path) -> None:
    """Who watches the loop hears of completed steps only: a link that hangs is not hidden by anything beside it."""
    link, alive = HangingLink(), list[float]()
    daemon = HeardDaemon(bench, link, on_alive=lambda: alive.append(time.monotonic()))
    with serving(daemon):
        until(lambda: len(alive) >= 5)
        link.may_return.clear()
        time.sleep(0.2)
        count = len(alive)
        time.sleep(0.5)
        assert len(alive) == count
        link.may_return.set()
        until(lambda: len(alive) > count + 3)


def test_a_process_that_stood_still_does_not_blame_its_inputs(bench: Path) -> None:
    looks: list[float] = []

    def sleep_at_first() -> None:
        looks.append(time.monotonic())
        if len(looks) == 1:
            time.sleep(2.5)  # longer than a silence that is reported

    daemon = HeardDaemon(bench, ScriptedLink(), on_alive=sleep_at_first)
    with serving(daemon):
        until(lambda: len(looks) >= 3)
    said = [notice.text for notice in daemon.notes.notices if notice.topic is Topic.INPUT]
    assert said[0].startswith("this process stood still for 2.")


@pytest.mark.parametrize("lift", ["still", "not available", "silent"])
def test_commands_stand_for_a_lift_sensor_while_it_is_dead(tmp_path: Path, lift: str) -> None:
    bench = load_bench(pulse_bench(tmp_path, EnergizingBy.LEVEL, "[learning]\nlockstep = true", THREE_MESSAGES))
    pulses, recording, bus = *injected(12), map_bus(bench)
    by_lift = layout_of(bus, stream_of(bus, Role.NEEDLE_LIFT))

    def served(first: int, last: int, knowledge: Knowledge | None, is_dead: bool, dead_from: int) -> HeardDaemon:
        """After events [first, last), one every 50 ms; is_dead: as the sensor is taken; dead_from: as it is."""
        begin, end = 0.125 + 0.05 * first, 0.125 + 0.05 * last
        lifts = misfired(recording, (0.125 + 0.05 * dead_from, 1.0))
        if lift == "not available" and dead_from == 0:
            lifts = replace(lifts, needle_lift=np.full_like(lifts.needle_lift, np.nan))
        sent = samples(lifts, (begin, end), bench=bench)
        if lift == "silent" and dead_from == 0:
            sent = [each for each in sent if each.frame_id != by_lift.frame_id]
        link = ScriptedLink(merged(sent, on_change([each for each in pulses if begin <= each[0] < end])))
        daemon = HeardDaemon(bench.with_lift_sensor(is_dead), link, knowledge=knowledge)
        with serving(daemon):
            until(link.empty.is_set)
        return daemon

    dying = served(0, 6, None, is_dead=False, dead_from=4)
    assert (dying.core.state[1], dying.is_lift_dead, bus.tells_commands) == (Reason.LIFT_DEAD, True, True)
    spared = served(6, 9, dying.core.knowledge, is_dead=True, dead_from=0)
    back = served(9, 12, spared.core.knowledge, is_dead=True, dead_from=99)
    notices = [each.text for each in spared.notes.notices if "frozen" in each.text]
    assert (spared.is_lift_dead, back.is_lift_dead, notices) == (True, False, [])
    assert (len(spared.notes.injections), len(back.notes.injections)) == (3, 3)
    for injection in (*spared.notes.injections, *back.notes.injections):
        assert injection.valid * injection.mass == pytest.approx(dying.notes.injections[0].mass, rel=0.01)
