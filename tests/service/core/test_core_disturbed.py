"""The core on disturbed traffic: nothing wrong is ever published as right, everything is counted, all recovers."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from observer_rt.estimation.scalars import NOZZLE
from observer_rt.observer.stream.state import Reason, State
from observer_rt.recording.replay.framing import Span
from observer_rt.simulation.simulate import SimulatedNoise
from tests.benches import ONE_MESSAGE, SAMPLE_RATE, THREE_MESSAGES, bench_text, sample_bench
from tests.device import Device, Traffic, damaged, later, protected, recoded, run, simulated

SETTLE = round(3e-3 * SAMPLE_RATE)
LOST = 9_100 // 9  # a frame in the standstill after the first event
IN_INJECTION = round(0.2008 * SAMPLE_RATE) // 9  # the second one


def test_flipped_bits_change_nothing_that_is_published(clean: Traffic) -> None:
    """Damaged copies before their good frame, any bit, as many as good ones."""
    random = np.random.default_rng(2)
    traffic = []
    for frame in clean.frames:
        traffic += [damaged(frame, int(random.integers(512))), frame]
    result = clean.run(traffic)
    assert result.frames == clean.result.frames
    assert result.core.counters.crc_errors == len(clean.frames)
    assert result.core.counters.lost_samples == 0


@pytest.mark.parametrize("length", [0, 1, 2, 3, 8, 63])
def test_frames_of_the_wrong_length_are_dropped_and_counted(clean: Traffic, length: int) -> None:
    traffic = list(clean.frames)
    traffic.insert(500, clean.frames[500]._replace(payload=clean.frames[500].payload[:length]))
    result = clean.run(traffic)
    assert result.frames == clean.result.frames
    assert result.core.counters.length_errors == 1


def test_repeated_frames_change_nothing(clean: Traffic) -> None:
    result = clean.run([frame for frame in clean.frames for _ in range(2)])
    assert result.frames == clean.result.frames
    assert result.core.counters.repeated_frames == len(clean.frames)
    assert result.core.counters.sequence_errors == 0


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
    summary = result.summaries[1]
    assert summary["Valid"] == 0


def test_interpolated_sample_does_not_interrupt(clean: Traffic) -> None:
    """One sample of one sensor not available in a good frame: marked, counted, and on it goes."""
    swapped = recoded(clean.frames[LOST], LinePressure_04=0xFFFF)
    result = clean.run([*clean.frames[:LOST], swapped, *clean.frames[LOST + 1 :]])
    assert set(result.rates) == set(clean.result.rates)
    assert result.core.counters.interpolated_samples == 1
    assert result.core.counters.lost_samples == 1


def test_reordered_frame_is_dropped(clean: Traffic) -> None:
    traffic = list(clean.frames)
    traffic[LOST], traffic[LOST + 1] = traffic[LOST + 1], traffic[LOST]
    result = clean.run(traffic)
    without = clean.without(LOST)
    assert result.frames == without.frames
    assert result.core.counters.old_frames == 1


def test_frame_of_another_message_of_ours_is_refused_by_its_data_id(clean: Traffic) -> None:
    """A good frame under a wrong identifier: the data id in the CRC tells."""
    foreign = protected(clean.frames[300], 0x110, 5)
    result = clean.run([*clean.frames[:400], foreign, *clean.frames[400:]])
    assert result.frames == clean.result.frames
    assert result.core.counters.crc_errors == 1


def test_restart_of_the_device(clean: Traffic) -> None:
    """Switched off and on: the same recording again from index 0, with a fresh counter."""
    result = clean.run([*clean.frames[:1200], *later(Device(clean.bench).send(simulated()), 0.3)])
    assert result.core.counters.restarts == 1
    assert result.core.counters.lost_samples == 0
    starts = [first for first, _, _ in result.rate_frames]
    again = starts.index(0, 1)
    assert starts[:again] == sorted(starts[:again])
    assert starts[again:] == sorted(starts[again:])
    states = [State(header["State"]) for _, header, _ in result.rate_frames]
    assert State.DEGRADED in states[again : again + 6]
    assert result.reports[-1].mass == pytest.approx(clean.result.reports[-1].mass, rel=0.01)


@pytest.mark.parametrize("messages", [ONE_MESSAGE, THREE_MESSAGES], ids=["one message", "three messages"])
def test_windowed_source(tmp_path: Path, messages: dict[str, str], clean: Traffic) -> None:
    """Only 6 ms round each injection is sent: a legal jump, after which 1 ms of shut needle is enough."""
    bench = sample_bench(tmp_path, messages)
    starts = [round((0.150 + 0.05 * event - 0.0035) * SAMPLE_RATE) for event in range(3)]
    result = run(bench, Device(bench).send(simulated(), *(Span(start, start + 28 * 18) for start in starts)))
    assert result.core.counters.jumps == 2
    assert result.core.counters.lost_samples == 0
    assert [report.event for report in result.reports] == [1, 2, 3]
    assert np.isfinite([report.mass for report in result.reports]).all()
    assert result.reports[2].mass == pytest.approx(clean.result.reports[2].mass, rel=0.03)


def test_jump_with_a_lost_frame_is_a_loss(clean: Traffic) -> None:
    device = Device(clean.bench)
    first, second = (device.send(simulated(), span) for span in (Span(0, 2700), Span(5400, 14_400)))
    assert clean.run([*first, *second]).core.counters.jumps == 1
    result = clean.run([*first[:-1], *second])
    assert result.core.counters.jumps == 0
    assert result.core.counters.lost_samples == 2700 + 9


@pytest.mark.parametrize("wrong", [lambda k: 9 * k + 1, lambda k: 9 * k - 1], ids=["one late", "one early"])
def test_index_off_by_one_is_noticed(clean: Traffic, wrong: Callable[[int], int]) -> None:
    """So that the comparisons above can fail: indices shifted by a sample give other rates."""
    traffic = [recoded(frame, SampleIndex=wrong(k)) for k, frame in enumerate(clean.frames[1:], start=1)]
    assert clean.run(traffic).rates != clean.result.rates


def test_roles_swapped_are_noticed(tmp_path: Path, clean: Traffic) -> None:
    """Rail and line pressure exchanged in the bench file: other rates, and a wear that is not there."""
    bench = tmp_path / "bench.toml"
    text = bench_text(ONE_MESSAGE).replace("RailPressure_", "X_")
    bench.write_text(text.replace("LinePressure_", "RailPressure_").replace("X_", "LinePressure_"))
    swapped = run(bench, clean.frames)
    assert swapped.rates != clean.result.rates
    assert abs(swapped.reports[-1].indicators[NOZZLE].value - 0.2) > 0.05


@pytest.mark.slow
def test_needle_signal_that_chatters_is_survived(clean: Traffic) -> None:
    """A lift sensor gone mad: thousands of openings in one event, each reported once or forgotten, in order."""
    good = simulated()
    lift = good.needle_lift.copy()
    shut = np.random.default_rng(1).normal(size=10_000) * SimulatedNoise().needle_lift
    lift[1000:11_000] = shut + np.where(np.arange(10_000) % 8 < 2, 50e-6, 0.0)
    mad = type(good)(good.time, good.rail_pressure, lift, good.line_pressure)
    result = clean.run(Device(clean.bench).send(mad))
    numbers = [report.number for report in result.reports]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] > 1200
    assert result.core.counters.samples == 14_994
    assert result.core.counters.events >= 2
    assert not any(report.valid for report in result.reports)
    assert result.core.state == (State.DEGRADED, Reason.MODEL_INADEQUATE)
