"""A second sender of our identifiers, while the daemon runs: told, counted, in the state and the status frame."""

import time
from pathlib import Path

import pytest

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.observer.stream.state import Reason, State
from observer_rt.recording.replay.framing import Framer, TimedFrame, whole
from observer_rt.service.daemon import Daemon
from observer_rt.service.reports.news import Notes
from observer_rt.service.words import Topic
from tests.service.end_to_end import RATE, STATUS
from tests.service.participants import ScriptedLink, bench_file, serving, until, worn_recording


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return bench_file(tmp_path_factory.mktemp("senders"), "senders-test")


def test_it_is_told_counted_and_shown(bench: Path) -> None:
    loaded = load_bench(bench)
    bus = map_bus(loaded)
    recording = worn_recording()
    ours = list(Framer(bus).frames(recording, whole(recording)))
    other = [TimedFrame(0.0, message.frame_id, False, True, bytes(64)) for message in (RATE, STATUS)]
    notes = Notes()
    link = ScriptedLink([*ours[:-100], *(3 * other), *ours[-100:]])
    daemon = Daemon(loaded, bus, [link], listeners=[notes])
    with serving(daemon):
        until(lambda: bool(notes.notices))
        assert daemon.state(time.monotonic_ns()) == (State.DEGRADED, Reason.SECOND_SENDER)
        until(lambda: link.statuses()[-1]["ForeignFrames"] == 6)
        until(lambda: any(notice.topic is Topic.SENDER and notice.is_over for notice in notes.notices))
        assert daemon.state(time.monotonic_ns())[1] is Reason.INPUT_TIMEOUT
    told = [notice.text for notice in notes.notices if notice.topic is Topic.SENDER]
    assert told[0].startswith("another node sends InjectionRate 0x200")
    assert told[1:] == ["the other sender is silent after 6 frames"]
    status = link.statuses()
    assert (State.DEGRADED, Reason.SECOND_SENDER, 0) in {
        (int(s["State"]), int(s["Reason"]), int(s["Valid"])) for s in status
    }
    assert daemon.core.processed == recording.samples


def test_ages_of_the_inputs_are_in_the_status(bench: Path) -> None:
    loaded = load_bench(bench)
    bus = map_bus(loaded)
    recording = worn_recording()
    ages = ("RailPressureAge", "NeedleLiftAge", "LinePressureAge")
    silent = ScriptedLink()
    with serving(Daemon(loaded, bus, [silent])):
        until(lambda: bool(silent.statuses()))
    assert all(silent.statuses()[-1][age] == 25.5 for age in ages)  # code 255: none came yet
    link = ScriptedLink(Framer(bus).frames(recording, whole(recording)))
    with serving(Daemon(loaded, bus, [link])):
        until(link.empty.is_set)
        until(lambda: link.statuses()[-1]["LinePressureAge"] >= 0.5)
    last = link.statuses()[-1]
    assert last["RailPressureAge"] == last["NeedleLiftAge"] == last["LinePressureAge"] < 25.0
