"""The core on clean and disturbed traffic, by cantools and autosar-e2e: nothing wrong is published as right."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import e2e.p05
import numpy as np
import pytest

from observer_rt.config.bench import load_bench
from observer_rt.config.injector_sections import E2EConfig
from observer_rt.core.frames.frames import E2EState
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.simulate import SimulatedNoise
from observer_rt.engine.stream.state import Reason, State
from observer_rt.files.replay.framing import Span, TimedFrame
from tests.benches import ONE_MESSAGE, SAMPLE_RATE, THREE_MESSAGES, sample_bench
from tests.daemon.end_to_end import DATABASE
from tests.device import RATES, Device, Traffic, core_of, damaged, hand, later, protected, run, simulated


def test_every_index_is_published_exactly_once(clean: Traffic) -> None:
    sent = 9 * len(clean.frames)
    covered = clean.result.covered
    assert covered[:sent] == list(range(sent))
    assert len(covered) - sent < RATES  # the last frame is filled up
    assert set(clean.result.rates) == set(range(50, sent))  # available after 1 ms of standstill
    assert clean.result.core.counters.samples == sent


def test_published_rate_is_that_of_the_observer(clean: Traffic) -> None:
    """Codes of 0.01 mm3/ms from -100 on, rounded; the last samples are still in the core's memory."""
    rows = clean.result.core.rows(0, clean.result.core.processed)
    for row in rows[~np.isnan(rows["injection_rate"])]:
        expected = (float(row["injection_rate"]) / 1e-6 + 100.0) / 0.01
        assert abs(clean.result.rates[int(row["index"])] - expected) <= 0.5 + 1e-6


def test_evaluation_of_the_recording_gives_the_same_frames(clean: Traffic) -> None:
    """`evaluate` codes the recording by its own encoder: what comes out is the same, bit for bit."""
    own = [frame.payload for frame in evaluate(load_bench(clean.bench), [simulated()]).frames]
    assert own[: len(clean.result.frames) - 5] == [frame.payload for frame in clean.result.frames][:-5]


@pytest.mark.parametrize("messages", [ONE_MESSAGE, THREE_MESSAGES], ids=["one message", "three messages"])
def test_stamps_change_nothing_where_messages_share_an_index(tmp_path: Path, messages: dict[str, str]) -> None:
    """Not a bit of what goes out, whatever the receiver's clock does: it stands still, or it runs wild."""
    bench = sample_bench(tmp_path, messages)
    frames = Device(bench).send(simulated(), Span(0, 14_000))
    random = np.random.default_rng(7)
    wild = [frame._replace(time=random.uniform(-4e9, 4e9)) for frame in frames]
    still = [frame._replace(time=0.0) for frame in frames]
    expected = run(bench, frames).frames
    assert run(bench, wild).frames == run(bench, still).frames == expected


def test_frames_of_others_change_nothing(clean: Traffic) -> None:
    core = core_of(clean.bench)
    out = []
    for frame in clean.frames:
        out += core.handle(0x7FF, False, b"\x00" * 8, 0)
        out += core.handle(frame.frame_id, True, frame.payload, 0)  # an extended frame with our number
        out += hand(core, [frame])
        out += core.handle(0x200, False, frame.payload, 0)  # our own output, by somebody else
    assert out + core.finish() == clean.result.frames
    assert core.counters.frames == len(clean.frames)


def test_three_messages_give_the_same_rates(tmp_path: Path, clean: Traffic) -> None:
    bench = sample_bench(tmp_path, THREE_MESSAGES)
    three = run(bench, Device(bench).send(simulated()))
    common = 28 * (simulated().samples // 28)
    assert three.core.counters.samples == common
    rates, expected_rates = ({i: c for i, c in of.rates.items() if i < common - 40} for of in (three, clean.result))
    assert rates == expected_rates
    assert [each["Mass"] for each in three.summaries] == [each["Mass"] for each in clean.result.summaries]


@pytest.mark.parametrize("start", [0xFFFFFFFF - 5001, 3_000_000_000])
def test_index_wraps_and_starts_anywhere(clean: Traffic, start: int) -> None:
    """At an even index, as the other: the zero of the lift is followed by the even samples."""
    moved = clean.run(Device(clean.bench, index=start).send(simulated()))
    assert (moved.core.counters.lost_samples, moved.core.counters.restarts) == (0, 0)
    codes = {(index - start) % (1 << 32): code for index, code in moved.rates.items()}
    assert codes == clean.result.rates


def test_summary_agrees_with_the_published_rate(clean: Traffic) -> None:
    """Mass by the decoded rate frames of its window, whose filters follow a worn nozzle from the first one on."""
    assert [summary["InjectionNumber"] for summary in clean.result.summaries] == [1, 2, 3]
    for summary in clean.result.summaries:
        window = range(int(summary["SampleIndex"]), int(summary["EndIndex"]) + 1)
        rate = np.array([clean.result.rates[index] * 0.01 - 100.0 for index in window])  # mm3/ms
        volume = float(np.trapezoid(rate)) / SAMPLE_RATE * 1e3  # mm3
        assert summary["Mass"] == pytest.approx(summary["Volume"] * 0.83, rel=1e-3)  # mg
        assert summary["Volume"] == pytest.approx(volume, rel=0.01)
        assert summary["PeakInjectionRate"] == pytest.approx(rate.max(), abs=0.02)
        assert summary["RailPressureAtStart"] == pytest.approx(100.0, abs=0.5)
        assert summary["InjectorId"] == 1


def test_wear_and_the_sigma_of_the_mass_go_out_with_the_summary(clean: Traffic) -> None:
    last = clean.result.summaries[-1]
    assert last["NozzleWear"] == pytest.approx(0.2, abs=0.03)
    assert 0.0 < last["NozzleWearSigma"] < 0.05
    assert last["Learning"] == 1
    for report, summary in zip(clean.result.reports, clean.result.summaries, strict=True):
        assert report.mass_ci95 is not None
        low, high = report.mass_ci95
        assert low < report.mass < high
        assert 2 * 1.96 * summary["MassSigma"] == pytest.approx((high - low) / 1e-6, abs=0.004)  # mg


def test_the_corrected_rate_goes_out_beside_all_else_under_the_same_indices(tmp_path: Path, clean: Traffic) -> None:
    """Once, with a counter and an identity of its own, in the codes of the live rate."""
    result = run(sample_bench(tmp_path, extra='[outputs]\ncorrected_rate = "CorrectedRate"\n'), clean.frames)
    message = DATABASE.get_message_by_name("CorrectedRate")
    sent = [frame.payload for frame in result.frames if frame.frame_id == message.frame_id]
    assert [each for each in result.frames if each.frame_id != message.frame_id] == clean.result.frames
    assert all(e2e.p05.e2e_p05_check(payload, message.frame_id, length=64) for payload in sent)
    frames = [message.decode(payload, scaling=False, decode_choices=False) for payload in sent]
    assert [frame["Counter"] for frame in frames] == list(range(len(sent)))
    for report in result.reports:
        assert report.corrected_rate is not None
        window = range(report.start_index, report.end_index + 1)
        own = [frame for frame in frames if frame["SampleIndex"] in window]
        assert [frame["SampleIndex"] for frame in own] == [*window][::RATES]
        assert {frame["Valid"] for frame in own} == {report.valid}
        codes = np.array([frame[f"InjectionRate_{k:02d}"] for frame in own for k in range(RATES)])
        assert np.abs(codes[: len(window)] - (report.corrected_rate / 1e-6 + 100.0) / 0.01).max() <= 0.5 + 1e-6
        assert (codes[len(window) :] == 0xFFFF).all()


def test_header_tells_validity_and_state(clean: Traffic) -> None:
    """Valid from the second judged event on, but for the last frame, cut short; adapted once a phi was adopted."""
    headers = {first: header for first, header, _ in clean.result.rate_frames}
    shut = 0.2 + 1.1e-3 + 0.27e-3 + 0.33e-3  # s: energizing, closing delay, fall of the needle
    second_judged = round((shut + 0.010 + 0.020) * SAMPLE_RATE)
    valid = [first for first, header in headers.items() if header["Valid"]]
    assert second_judged - 5 < min(valid) < second_judged + RATES + 5
    assert [first for first in headers if first >= min(valid)][:-1] == valid
    states = [State(header["State"]) for header in headers.values()]
    assert states[0] is State.STARTING
    assert State.RUNNING_NOMINAL in states
    assert states[-1] is State.ADAPTED
    assert clean.result.core.state == (State.ADAPTED, Reason.NONE)


Frames = list[TimedFrame]
SETTLE = round(3e-3 * SAMPLE_RATE)
LOST = 9_100 // 9  # a frame in the standstill after the first event
IN_INJECTION = round(0.2008 * SAMPLE_RATE) // 9  # the second one


def with_another(frames: Frames, other: TimedFrame) -> Frames:
    return [*frames[:500], other, *frames[500:]]


def with_one_cut(length: int, frames: Frames) -> Frames:
    return with_another(frames, frames[500]._replace(payload=frames[500].payload[:length]))


SPOILT: dict[str, tuple[str, Callable[[Frames], Frames]]] = {
    "a damaged copy before each, any bit": (
        "crc_errors",
        lambda frames: [
            one
            for frame, bit in zip(frames, np.random.default_rng(2).integers(512, size=len(frames)), strict=True)
            for one in (damaged(frame, int(bit)), frame)
        ],
    ),
    "each twice": ("repeated_frames", lambda frames: [frame for frame in frames for _ in range(2)]),
    # good under a wrong identifier: the data id in the CRC tells
    "one of another message": ("crc_errors", lambda frames: with_another(frames, protected(frames[300], 0x110, 5))),
    **{
        f"one cut to {length} bytes": ("length_errors", partial(with_one_cut, length))
        for length in (0, 1, 2, 3, 8, 63)
    },
}


@pytest.mark.parametrize("name", SPOILT)
def test_spoilt_frames_among_good_ones_are_counted_and_change_nothing(clean: Traffic, name: str) -> None:
    counter, spoilt = SPOILT[name]
    traffic = spoilt(clean.frames)
    result = clean.run(traffic)
    counters = result.core.counters
    assert result.frames == clean.result.frames
    assert getattr(counters, counter) == len(traffic) - len(clean.frames) > 0
    assert (counters.lost_samples, counters.sequence_errors) == (0, 0)
    assert counters.since(clean.result.core.counters).samples == 0


def test_lost_frame_is_not_available_and_then_valid_again(clean: Traffic) -> None:
    result = clean.without(LOST)
    lost = range(9 * LOST, 9 * LOST + 9)
    rates, right = result.rates, clean.result.rates
    missing = sorted(set(right) - set(rates))
    assert missing == list(range(lost[0], lost[-1] + 1 + SETTLE + 1))
    assert {i: c for i, c in rates.items() if i < lost[0]} == {i: c for i, c in right.items() if i < lost[0]}
    late = [i for i in rates if i > 10_000]  # the next injection: the same learning, the same rates
    assert max(abs(rates[i] - right[i]) for i in late) <= 20  # of 0.01 mm3/ms
    assert result.core.counters.lost_samples == 9
    states = {State(header["State"]) for first, header, _ in result.rate_frames if first > lost[-1]}
    assert State.DEGRADED in states
    assert result.core.state == (State.ADAPTED, Reason.NONE)


def test_lost_indices_are_never_published_as_numbers(clean: Traffic) -> None:
    """Many losses everywhere: of what was lost nothing is available, of the rest nothing is there twice."""
    random = np.random.default_rng(4)
    lost = set(random.choice(len(clean.frames), 60, replace=False).tolist())
    result = clean.run([frame for k, frame in enumerate(clean.frames) if k not in lost])
    gone = {9 * k + i for k in lost for i in range(9)}
    assert not gone & set(result.rates)
    covered = result.covered
    assert sorted(set(covered)) == sorted(covered)
    assert set(range(9 * len(clean.frames))) - gone <= set(covered)
    assert result.core.counters.lost_samples == len(gone)


def test_frame_lost_in_an_injection_makes_it_invalid_only(clean: Traffic) -> None:
    result = clean.without(IN_INJECTION)
    assert [report.event for report in result.reports][:2] == [1, 2]
    second = result.reports[1]
    assert not second.valid
    assert second.reason is not Reason.NONE
    assert not np.isfinite(result.reports[2].mass) or result.reports[2].event == 3
    assert result.core.state == (State.ADAPTED, Reason.NONE)
    assert result.summaries[1]["Valid"] == 0


def test_an_input_whose_protection_is_invalid_is_not_taken_until_it_is_valid_again(clean: Traffic) -> None:
    """Of 20 frames every third is right: without the state machine these would be taken."""
    first = len(clean.frames) // 2
    frames = list(clean.frames)
    for n in range(first, first + 20):
        if n % 3:
            frames[n] = damaged(frames[n], 40)
    core = core_of(clean.bench)
    hand(core, frames[: first + 20])
    assert core.protection == [E2EState.INVALID]
    assert core.state == (State.DEGRADED, Reason.INPUT_PROTECTION)
    refused = core.counters.refused_frames
    assert refused > 0
    hand(core, frames[first + 20 : first + 40])
    assert core.protection == [E2EState.VALID]
    assert core.state[1] is not Reason.INPUT_PROTECTION
    assert refused < core.counters.refused_frames < refused + 10
    assert core.counters.lost_samples == 9 * (core.counters.crc_errors + core.counters.refused_frames)


def test_the_window_of_the_bench_file_counts(clean: Traffic) -> None:
    limits = E2EConfig(window=3, valid_max_errors=0, init_max_errors=0, invalid_max_errors=0, invalid_min_ok=3)
    core = core_of(load_bench(clean.bench).with_sections(e2e=limits))
    frames = list(clean.frames[:30])
    frames[20] = damaged(frames[20], 40)
    hand(core, frames[:20])
    assert core.protection == [E2EState.VALID]
    hand(core, frames[20:23])
    assert core.protection == [E2EState.INVALID]
    hand(core, frames[23:24])
    assert (core.protection, core.counters.refused_frames) == ([E2EState.VALID], 2)


def test_restart_of_the_device(clean: Traffic) -> None:
    """Switched off and on: the same recording again from index 0, with a fresh counter."""
    result = clean.run([*clean.frames[:1200], *later(Device(clean.bench).send(simulated()), 0.3)])
    assert (result.core.counters.restarts, result.core.counters.lost_samples) == (1, 0)
    starts = [first for first, _, _ in result.rate_frames]
    again = starts.index(0, 1)
    assert (starts[:again], starts[again:]) == (sorted(starts[:again]), sorted(starts[again:]))
    states = [State(header["State"]) for _, header, _ in result.rate_frames]
    assert State.DEGRADED in states[again : again + 6]
    assert result.reports[-1].mass == pytest.approx(clean.result.reports[-1].mass, rel=0.01)


@pytest.mark.parametrize("messages", [ONE_MESSAGE, THREE_MESSAGES], ids=["one message", "three messages"])
def test_windowed_source(tmp_path: Path, messages: dict[str, str], clean: Traffic) -> None:
    """Only 6 ms round each injection is sent: a legal jump, after which 1 ms of shut needle is enough."""
    bench = sample_bench(tmp_path, messages)
    starts = [round((0.150 + 0.05 * event - 0.0035) * SAMPLE_RATE) for event in range(3)]
    result = run(bench, Device(bench).send(simulated(), *(Span(start, start + 28 * 18) for start in starts)))
    assert (result.core.counters.jumps, result.core.counters.lost_samples) == (2, 0)
    assert [report.event for report in result.reports] == [1, 2, 3]
    assert np.isfinite([report.mass for report in result.reports]).all()
    assert result.reports[2].mass == pytest.approx(clean.result.reports[2].mass, rel=0.03)


@pytest.mark.slow
def test_needle_signal_that_chatters_is_survived(clean: Traffic) -> None:
    """A lift sensor gone mad: thousands of openings are reported once or forgotten; nothing is learned."""
    good = simulated()
    lift = good.needle_lift.copy()
    shut = np.random.default_rng(1).normal(size=7_000) * SimulatedNoise().needle_lift
    lift[1000:8_000] = shut + np.where(np.arange(7_000) % 8 < 2, 50e-6, 0.0)
    result = clean.run(Device(clean.bench).send(type(good)(good.time, good.rail_pressure, lift, good.line_pressure)))
    numbers = [report.number for report in result.reports]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] > 800
    assert result.core.counters.samples == 14_994
    assert result.core.counters.events >= 2
    assert [report.number for report in result.reports if report.valid] == numbers[-1:]
    assert result.core.state == (State.ADAPTED, Reason.NONE)
