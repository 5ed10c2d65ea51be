"""Openings, injections, events: what belongs together, where windows end, when an event is judged."""

import numpy as np
import pytest

from observer_rt.core.stream.stream import MAX_EVENT, RING, Break
from observer_rt.engine.observer import Durations
from observer_rt.engine.stream.state import Reason, State
from observer_rt.model.effects import sized
from tests.engine.sample_stream import RAIL, Stream, lift_with

MS = 100  # samples at 100 kHz
GAP, DELAY = 10 * MS, 20 * MS


def run(openings: dict[int, int], length: int, **options: object) -> Stream:
    """openings: first open sample, samples open."""
    return Stream(**options).move(lift_with(length, openings))  # type: ignore[arg-type]


def test_pilot_main_and_post_are_one_event_and_have_a_window_each() -> None:
    """From 0.15 ms before its opening to 0.5 ms after it is shut, or to where the next one begins."""
    stream = run({1000: 30, 1060: 110, 1400: 40}, 6000)
    assert stream.count("judgement", "events_judged") == 1
    assert [(int(i["number"]), int(i["event"])) for i in stream.injections] == [(1, 1), (2, 1), (3, 1)]
    first, second, third = stream.injections
    assert (int(first["start_index"]), int(first["end_index"])) == (1000 - 15, 1060 - 15)
    assert (int(second["start_index"]), int(second["end_index"])) == (1060 - 15, 1170 + 50)
    assert (int(third["start_index"]), int(third["end_index"])) == (1400 - 15, 1440 + 50)


def test_window_of_a_slow_opening_begins_at_the_foot_of_its_ramp() -> None:
    lift = lift_with(3000, {1000: 110})
    lift[998:1000] = 0.9e-6, 1.7e-6  # below the dead band, above the noise
    stream = Stream().move(lift)
    assert int(stream.injections[0]["start_index"]) == 998 - 15


@pytest.mark.parametrize(
    ("opened", "later", "events"),
    [(50, GAP - 1, 1), (50, GAP + 4, 2), (GAP, GAP + 3 * MS - 5, 1), (GAP, GAP + 3 * MS + 5, 2)],
)
def test_event_gap_and_a_needle_shut_long_enough_part_events(opened: int, later: int, events: int) -> None:
    """An opening within the gap since the first one is of that event. Shut for so long, x^ begins anew, from x~."""
    stream = run({1000: opened, 1000 + later: 50}, 8000, events_required=0)
    assert stream.count("event", "number") == events


def test_the_first_events_need_not_last_their_gap() -> None:
    """As many as are required before anything is valid; the third is of all openings within the gap."""
    period = round(4.2 * MS)
    stream = run(dict.fromkeys(range(1000, 1000 + 12 * period, period), 110), 12_000)
    assert [int(i["event"]) for i in stream.injections] == [1, 2, 3, 3, 3, 4, 4, 4, 5, 5, 5, 6]
    valid = [bool(i["valid"]) for i in stream.injections]
    assert valid == [False] * 8 + [True] * 4  # 20 ms after the third opened the second is judged


def test_nor_does_a_needle_that_was_not_shut_long_enough_end_them() -> None:
    stream = run({1000: 30, 1000 + 30 + 3 * MS - 5: 110, 8000: 50}, 12_000)
    assert [int(i["event"]) for i in stream.injections] == [1, 1, 2]


@pytest.mark.parametrize("period", [6 * MS, 8 * MS, round(10.5 * MS)])
def test_openings_without_end_are_judged_and_valid(period: int) -> None:
    """At any rhythm that leaves 3 ms of shut needle; every injection is reported once."""
    openings = dict.fromkeys(range(1000, 60_000, period), 110)
    stream = run(openings, 62_000)
    assert len(stream.injections) == len(openings)
    assert stream.rows["valid"][6000 + 4 * GAP : 59_000].all()
    assert stream.count("judgement", "events_judged") >= (59_000 - DELAY - GAP) // (GAP + period)


def test_openings_that_leave_no_standstill_say_so() -> None:
    """2.5 ms are not enough: the sac may still be filled; the injections are over and reported all the same."""
    stream = run(dict.fromkeys(range(1000, 99_000, round(3.6 * MS)), 110), 99_000)
    rows = stream.rows[60_000:]
    assert (rows["reason"] == Reason.NO_STANDSTILL).all()
    assert (rows["state"] == State.DEGRADED).all()
    assert stream.count("judgement", "events_judged") > 1
    assert Reason(int(stream.injections[-5]["reason"])) is Reason.NO_STANDSTILL
    assert stream.stay_shut(40e-3).rows["reason"][-1] != Reason.NO_STANDSTILL


@pytest.mark.parametrize("gap_ms", [2.0, 10.0, 50.0])
@pytest.mark.parametrize("delay_ms", [0.0, 20.0, 100.0])
def test_event_is_judged_a_fixed_time_after_it_closed(gap_ms: float, delay_ms: float) -> None:
    stream = run({1000: 50}, 20_000, durations=Durations(gap_ms * 1e-3, delay_ms * 1e-3))
    closed = 1050 + round(gap_ms * MS)  # the last sample of its window
    assert stream.judged == [max(closed + round(delay_ms * MS), closed + 1)]


def test_judgement_waits_for_an_injection_under_way() -> None:
    """Due in the middle of the second event: judged at the first sample with the needle long shut."""
    due = 1050 + GAP + DELAY
    stream = run({1000: 50, due - 20: 50}, 12_000)
    second_shut = due - 20 + 50
    assert stream.judged == [second_shut + 3 * MS + 1, second_shut + GAP + DELAY]


def test_judgement_comes_before_the_opening_that_would_delay_it() -> None:
    due = 1050 + GAP + DELAY
    stream = run({1000: 50, due + 4: 50}, 12_000)
    assert stream.judged[0] == due


def test_many_events_wait_for_their_judgement() -> None:
    """A long learning delay and short gaps: every event is judged once, in order, at its time."""
    gap, delay = 2 * MS, 100 * MS
    starts = list(range(1000, 1000 + 40 * 3 * MS, 3 * MS))
    stream = run(dict.fromkeys(starts, 20), 30_000, durations=Durations(2e-3, 100e-3))
    assert stream.count("event", "number") == len(starts)
    outside = [start + 20 + gap + delay for start in starts]
    assert len(stream.judged) == len(starts)
    for judged, due in zip(stream.judged, outside, strict=True):
        assert due <= judged < due + 3 * MS


def test_end_of_the_stream_judges_what_is_left() -> None:
    stream = run({1000: 50}, 1100).finish()
    assert stream.count("positions", "processed") == 1100
    assert stream.count("judgement", "events_judged") == 1


@pytest.mark.parametrize("opened", [True, False])
def test_break_in_the_stream_ends_the_event(opened: bool) -> None:
    """With an open needle nothing can be learned from it; long shut, all of it can."""
    length = 1030 if opened else 1050 + 5 * MS
    stream = run({1000: 50}, length, learning=True)
    stream.stay_shut(40e-3, index=length + 100, broken=Break.LOSS)
    assert (stream.count("judgement", "events_judged"), stream.outcomes[0] is None) == (1, opened)


def test_index_that_begins_anew_judges_at_once() -> None:
    """The index the event was due at will not come again."""
    stream = run({9000: 50}, 9500)
    stream.stay_shut(5e-3, index=0, broken=Break.RESTART)
    assert stream.judged == [0]


def test_all_is_the_same_wherever_the_index_of_the_device_begins() -> None:
    """Positions count from 0. Where one was taken for an index, or the other way, it is a million samples off."""
    first_index, length = 1_000_000, 16_000
    random = np.random.default_rng(2)
    noise = [random.normal(0.0, sigma, length) for sigma in (0.1e6, 0.1e-6, 0.05e6)]
    rail, lift, line = np.array([RAIL, 0.0, RAIL])[:, None] + noise
    lift += lift_with(length, {9000: 30, 9150: 110, 9210: 40, 11_000: 110, 13_500: 50})
    lift[5000:5400] += 8e-6  # more than the dead band, but no opening
    runs = []
    for index in (0, first_index):
        stream = Stream(learning=True, stated=(sized("rail_pressure_skew", d=27e-6),))
        stream.feed(rail, lift, line, index).stay_shut(30e-3, index=index + 17_000, broken=Break.LOSS)
        runs.append(stream.feed(rail, lift, line).finish())
    counted, shifted = runs
    assert len(counted.injections) >= 8
    assert counted.count("judgement", "events_judged") >= 5
    assert [max(index - first_index, -1) for index in shifted.judged] == counted.judged
    closed = counted.count("counts", "events_closed")
    for expected, records in (
        (counted.rows, shifted.rows),
        (counted.injections, shifted.injections),
        (counted.observer.events[:closed], shifted.observer.events[:closed]),
    ):
        for name in expected.dtype.names or ():
            values = records[name]
            if name.endswith("index"):
                values = np.where(values < 0, -1, values - first_index)  # -1: an event that is due at once
            assert values.tobytes() == expected[name].tobytes(), name


def test_opening_that_cuts_a_window_short_counts_with_its_own_sample() -> None:
    """Not with what stood in its place of the ring one lap before, when nothing was valid yet."""
    first, lap = 1000, RING
    stream = run({first: 110, first + 6000: 110, first + lap - 60: 30, first + lap: 110}, first + lap + 6000)
    pilot = stream.injections[2]
    rows = stream.rows[int(pilot["start_position"]) : int(pilot["end_position"]) + 1]
    assert int(pilot["end_index"]) == first + lap - 15  # where the next one begins
    expected = float(np.trapezoid(rows["injection_rate"])) * 1e-5
    assert float(pilot["volume"]) == pytest.approx(expected, rel=1e-12)
    assert float(pilot["peak_rate"]) == rows["injection_rate"].max()
    assert pilot["valid"]


def test_injection_in_time_not_synchronised_has_no_volume() -> None:
    (injection,) = run({100: 50}, 6000).injections
    assert np.isnan(injection["volume"])
    assert np.isnan(injection["peak_rate"])
    assert not injection["valid"]
    assert Reason(int(injection["reason"])) is Reason.STARTING


def test_needle_that_never_shuts_is_reported() -> None:
    """Open longer than any injection: not valid, not available, and nothing is learned."""
    stream = Stream(events_required=0, learning=True).stay_shut(10e-3).move(np.full(MAX_EVENT + 4000, 0.3e-3))
    last = stream.rows[-1]
    assert not last["valid"]
    assert Reason(int(last["reason"])) is Reason.NEEDLE_STUCK
    assert State(int(last["state"])) is State.DEGRADED
    assert np.isnan(last["injection_rate"])
    stream.stay_shut(60e-3)
    assert stream.outcomes == [None]
    assert stream.rows[-1]["valid"]
