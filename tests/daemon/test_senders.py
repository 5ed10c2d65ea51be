"""A second sender of our identifiers, while the daemon runs: reported, counted, and no result is valid."""

import time
from collections.abc import Iterable
from pathlib import Path

import pytest

from observer_rt.daemon.log import injection_line
from observer_rt.engine.reports.injection_report import FIELDS, Output, row_of
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.stream.validity import contested
from observer_rt.engine.words import Topic
from observer_rt.files.replay.framing import TimedFrame
from tests.daemon.end_to_end import RATE, STATUS, SUMMARY, decoded
from tests.daemon.participants import HeardDaemon, ScriptedLink, serving, until
from tests.device import encoded, frames_of, worn_recording

INJECTIONS = 8
OTHER = Reason.SECOND_SENDER
AFTER_FOUR, AFTER_SIX = 0.348, 0.448  # s, when the last of as many was judged, just before the next one


def test_it_is_told_counted_and_shown(bench: Path) -> None:
    recording = worn_recording()
    ours = frames_of(bench, recording)
    other = [encoded(message, bytes(64)) for message in (RATE, STATUS)]
    link = ScriptedLink([*ours[:-100], *(3 * other), *ours[-100:]])
    daemon = HeardDaemon(bench, link)
    notes = daemon.notes
    with serving(daemon):
        until(lambda: bool(notes.notices))
        until(lambda: link.statuses()[-1]["ForeignFrames"] == 6)
        until(lambda: any(notice.topic is Topic.SENDER and notice.is_over for notice in notes.notices))
        assert daemon.now()[1] is Reason.INPUT_TIMEOUT
    texts = [notice.text for notice in notes.notices if notice.topic is Topic.SENDER]
    assert texts[0].startswith("another node sends InjectionRate 0x200")
    assert texts[1:] == ["the other sender is silent after 6 frames"]
    status = link.statuses()
    assert (State.DEGRADED, Reason.SECOND_SENDER, 0) in {
        (int(s["State"]), int(s["Reason"]), int(s["Valid"])) for s in status
    }
    assert daemon.core.processed == recording.samples


def test_ages_of_the_inputs_are_in_the_status(bench: Path) -> None:
    ages = ("RailPressureAge", "NeedleLiftAge", "LinePressureAge")
    silent = ScriptedLink()
    with serving(HeardDaemon(bench, silent)):
        until(lambda: bool(silent.statuses()))
    assert all(silent.statuses()[-1][age] == 25.5 for age in ages)  # code 255: none came yet
    link = ScriptedLink(frames_of(bench, worn_recording()))
    with serving(HeardDaemon(bench, link)):
        until(link.empty.is_set)
        until(lambda: link.statuses()[-1]["LinePressureAge"] >= 0.5)
    last = link.statuses()[-1]
    assert last["RailPressureAge"] == last["NeedleLiftAge"] == last["LinePressureAge"] < 25.0


class FedLink(ScriptedLink):
    def feed(self, frames: Iterable[TimedFrame]) -> None:
        self._frames.extend(frames)
        until(lambda: not self._frames)
        self.empty.clear()
        until(self.empty.is_set)

    def taken(self, identifier: int) -> list[bytes]:
        payloads = [frame.payload for frame in self.sent if frame.frame_id == identifier]
        self.sent = [frame for frame in self.sent if frame.frame_id != identifier]
        return payloads


def marks(payloads: list[bytes]) -> set[tuple[int, int]]:
    return {(int(s["Valid"]), int(s["State"])) for s in (decoded(RATE, payload) for payload in payloads)}


def test_nothing_is_valid_while_there_is_one(bench: Path) -> None:
    """In rates, summaries, reports and status alike, from its first frame until it is silent; then as before."""
    recording = worn_recording(INJECTIONS)
    frames = frames_of(bench, recording)
    first, second = (round(at * len(frames) / recording.time[-1]) for at in (AFTER_FOUR, AFTER_SIX))
    other = encoded(STATUS, bytes(64))
    link = FedLink()
    daemon = HeardDaemon(bench, link)
    notes = daemon.notes
    with serving(daemon):
        link.feed(frames[:first])
        until(lambda: (1, State.ADAPTED) in marks(link.taken(RATE.frame_id)))
        until(lambda: daemon.core.counters.frames == first)
        link.feed([other])
        until(lambda: Reason.SECOND_SENDER in daemon.standing(time.monotonic_ns())[1])
        time.sleep(0.1)  # for rates from before to be sent
        while link.taken(RATE.frame_id):
            time.sleep(0.1)
        for k in range(first, second, 100):  # it goes on as long as these take, however slow the machine is
            link.feed([other, *frames[k : min(k + 100, second)]])
        until(lambda: daemon.core.counters.frames == second)
        assert marks(link.taken(RATE.frame_id)) == {(0, State.DEGRADED)}
        assert daemon.now() == (State.DEGRADED, Reason.SECOND_SENDER)
        until(lambda: daemon.standing(time.monotonic_ns())[1] == (Reason.INPUT_TIMEOUT, Reason.SECOND_SENDER))
        until(lambda: any(each.is_over for each in notes.notices if each.topic is Topic.SENDER))
        until(lambda: not daemon.arrivals.is_contested(time.monotonic_ns()))
        link.feed(frames[second:])
        until(lambda: len(notes.injections) == INJECTIONS)
    rates = link.taken(RATE.frame_id)
    before_the_stop = marks(rates[:-1])
    # the block under way when it began, at the most
    assert before_the_stop <= {(0, State.DEGRADED), (1, State.ADAPTED)}
    assert (1, State.ADAPTED) in before_the_stop
    assert marks(rates[-1:]) == {(0, State.ADAPTED)}  # the stop cuts it short
    summaries = [decoded(SUMMARY, payload) for payload in link.taken(SUMMARY.frame_id)]
    said = [(int(s["Valid"]), int(s["State"]), int(s["Reason"])) for s in summaries]
    assert said == [(each.valid, each.state, each.reason) for each in notes.injections]
    assert [each.reasons for each in notes.injections] == [(), (), (), (), (OTHER,), (OTHER,), (), ()]
    odd = notes.injections[4]
    assert odd.state is State.DEGRADED
    assert injection_line(odd).endswith("not valid: SECOND_SENDER: another node sends what only this observer should")
    row = row_of(FIELDS, Output.JOURNAL, odd, daemon.core.compiled.observer.constants.coefficients)
    assert (row["valid"], row["reasons"], row["state"]) == (0, "SECOND_SENDER", "DEGRADED")


@pytest.mark.parametrize(
    ("own", "reason", "state", "reasons"),
    [
        (State.ADAPTED, Reason.NONE, State.DEGRADED, (OTHER,)),
        (State.RUNNING_NOMINAL, Reason.TOO_FEW_EVENTS, State.DEGRADED, (OTHER, Reason.TOO_FEW_EVENTS)),
        (State.DEGRADED, Reason.MODEL_INADEQUATE, State.DEGRADED, (Reason.MODEL_INADEQUATE, OTHER)),
        (State.WAITING_FOR_DATA, Reason.INPUT_TIMEOUT, State.WAITING_FOR_DATA, (Reason.INPUT_TIMEOUT, OTHER)),
    ],
)
def test_it_hides_no_other_reason(own: State, reason: Reason, state: State, reasons: tuple[Reason, ...]) -> None:
    assert contested(own, reason) == (state, reasons)


def test_the_log_says_all_reasons(bench: Path) -> None:
    """Of a bench whose inputs stay away while another node sends."""
    link = FedLink()
    daemon = HeardDaemon(bench, link)
    with serving(daemon):
        link.feed([encoded(STATUS, bytes(64))])
        until(lambda: any(notice.topic is Topic.STATE for notice in daemon.notes.notices))
    text = next(notice.text for notice in daemon.notes.notices if notice.topic is Topic.STATE)
    assert text.startswith("WAITING_FOR_DATA: no input comes in; SECOND_SENDER: another node sends")
    assert "; STARTING: the observer has just begun; SampleBlock 0x100" in text
