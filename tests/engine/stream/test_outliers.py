"""Spikes, frozen and clipped stretches, dropouts: recognised sample by sample, bridged, and gone by themselves."""

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.core.stream.stream import CHANGE_MEMORY as MEMORY
from observer_rt.core.stream.stream import CLOSE, FEWEST_REPEATS, RESTLESS, STEP
from observer_rt.engine.observer import Durations
from observer_rt.engine.stream.state import LIFT, LINE, RAIL, Reason
from tests.engine.sample_stream import NOISE, Stream, lift_with, stroke
from tests.engine.sample_stream import RAIL as PRESSURE

COUNT = 6000
AT = 4000  # where something happens, in a needle long shut
BRIDGE = 50  # samples, as Durations has it
REST: Mapping[int, int] = {}


def signals(
    count: int = COUNT, step: float = 0.005e6, seed: int = 1, strokes: Mapping[int, NDArray[np.float64] | int] = REST
) -> list[NDArray[np.float64]]:
    """Rail pressure, lift and line pressure with their noise, as a bus of this resolution [Pa] has them."""
    noise = np.random.default_rng(seed).normal(size=(3, count))
    rail = PRESSURE + NOISE.rail_pressure * noise[0]
    lift = np.rint(NOISE.needle_lift * noise[1] / 1e-8) * 1e-8 + lift_with(count, strokes)
    line = PRESSURE + NOISE.line_pressure * noise[2]
    return [np.rint(rail / step) * step, lift, np.rint(line / step) * step]


def observed(channels: list[NDArray[np.float64]], **options: object) -> tuple[Stream, NDArray[np.void]]:
    stream = Stream(**options)  # type: ignore[arg-type]
    rail, lift, line = channels
    stream.feed(rail, lift, line).finish()
    return stream, stream.rows


def bridged(rows: NDArray[np.void], channel: int) -> list[int]:
    return [int(k) for k in np.flatnonzero(rows["bridged"] >> channel & 1)]


def as_recorded(rows: NDArray[np.void], channel: int) -> NDArray[np.float64]:
    """Values of the rows [Pa or m] after what was done to them, less what the first one is."""
    return np.asarray(rows[("rail_pressure", "needle_lift", "line_pressure")[channel]], np.float64)


def spike_before(values: NDArray[np.float64], k: int, limit: float) -> int:
    """How many values before k leapt away and came back: the plain reference, 0 for none."""
    back = abs(values[k] - values[k - 1])
    for width in (1, 2, 3):
        earlier = values[k - width - 3 : k - width]
        away = abs(values[k - width] - earlier[-1])
        close = CLOSE * min(away, back)
        slope = (earlier[2] - earlier[0]) / 2
        missed = min(abs(values[k] - earlier[-1]), abs(values[k] - earlier[-1] - (width + 1) * slope))
        is_steady = np.abs(np.diff(earlier)).max() < close
        if min(away, back) > limit and is_steady and missed < close:
            return width
    return 0


@pytest.mark.parametrize("width", [1, 2, 3])
@pytest.mark.parametrize("channel", [RAIL, LINE])
def test_a_spike_of_up_to_three_samples_is_replaced_by_what_is_beside_it(channel: int, width: int) -> None:
    clean, spiked = signals(), signals()
    spiked[channel][AT : AT + width] += 3e6
    stream, rows = observed(spiked)
    assert bridged(rows, channel) == list(range(AT, AT + width))
    assert stream.count("outliers", "spikes") == width
    _, wanted = observed(clean)
    error = as_recorded(rows, channel) - as_recorded(wanted, channel)
    assert np.abs(error[AT : AT + width]).max() < 6 * as_recorded(wanted, channel).std()
    assert not error[:AT].any()
    assert not error[AT + width :].any()


def test_what_is_replaced_is_what_the_plain_reference_finds() -> None:
    channels = signals(seed=3)
    rng = np.random.default_rng(5)
    for at in range(1000, COUNT - 100, 40):
        height = rng.normal() * 14 * NOISE.line_pressure
        channels[LINE][at : at + rng.integers(1, 5)] += height
    _, rows = observed(channels)
    values, result, change = channels[LINE].copy(), [], 0.0
    for k in range(1, COUNT):
        step = abs(channels[LINE][k] - channels[LINE][k - 1])
        limit = max(STEP * NOISE.line_pressure, RESTLESS * change)
        change += (min(step, limit) - change) / MEMORY
        limit = max(STEP * NOISE.line_pressure, RESTLESS * change)
        width = spike_before(values, k, limit) if k > 7 else 0
        for j in range(width):
            values[k - 1 - j] = values[k] + (values[k - width - 1] - values[k]) * (j + 1) / (width + 1)
            result.append(k - 1 - j)
    assert len(result) > 40
    assert bridged(rows, LINE) == sorted(result)


def test_a_channel_that_rings_has_no_spikes() -> None:
    channels = signals()
    channels[LINE] += 2e6 * np.cos(2.0 * np.pi * np.arange(COUNT) / 4.2)
    stream, _ = observed(channels)
    assert stream.count("outliers", "spikes") < 5


def test_noise_and_the_edges_of_an_injection_are_no_spikes() -> None:
    channels = signals(100_000, seed=18, strokes={4500: 150})
    channels[LINE][4500:4530] -= np.linspace(0.0, 20e6, 30)
    channels[LINE][4530:] -= 20e6
    stream, rows = observed(channels)
    assert (stream.count("outliers", "spikes"), stream.count("outliers", "bridged")) == (0, 0)
    assert bridged(rows, RAIL) + bridged(rows, LINE)  # what stands out by chance is replaced all the same


@pytest.mark.parametrize("channel", [RAIL, LINE])
def test_a_frozen_stretch_is_bridged_from_its_first_repeat_on(channel: int) -> None:
    channels = signals()
    channels[channel][AT : AT + 30] = channels[channel][AT]
    stream, rows = observed(channels)
    assert bridged(rows, channel) == list(range(AT + 1, AT + 30))
    assert stream.count("outliers", "bridged") == 29
    assert not rows["doubt"].any()


def test_x_goes_on_without_correction_over_a_frozen_line_pressure() -> None:
    channels = signals()
    channels[LINE][AT : AT + 40] = PRESSURE + 5e6
    _, rows = observed(channels)
    held = rows[AT + 1 : AT + 40]
    assert not held["innovation"].any()
    assert np.abs(held["x_tilde"][:, 0] - rows["x_tilde"][AT - 1, 0]).max() * 100e6 < 1e6


@pytest.mark.parametrize("channel", [RAIL, LIFT, LINE])
def test_beyond_the_bridge_nothing_is_valid_and_then_it_is_back_by_itself(channel: int) -> None:
    channels = signals()
    channels[channel][AT : AT + 300] = channels[channel][AT]
    _, rows = observed(channels, events_required=0)
    frozen = np.flatnonzero(rows["reason"] == Reason.INPUT_FROZEN)
    assert AT + BRIDGE < frozen[0] <= AT + BRIDGE + 2
    assert frozen[-1] < AT + 300 + 2 * BRIDGE
    assert frozen.size == frozen[-1] - frozen[0] + 1
    assert rows["valid"][[AT - 1, AT + 20, -1]].all()


def test_the_time_that_is_bridged_is_stated() -> None:
    channels = signals()
    channels[LINE][AT : AT + 300] = channels[LINE][AT]
    _, rows = observed(channels, durations=Durations(bridge=4e-3))
    assert not rows["doubt"].any()
    _, rows = observed(channels, durations=Durations(bridge=0.1e-3))
    assert int(np.flatnonzero(rows["doubt"])[0]) < AT + 15


@pytest.mark.parametrize("channel", [RAIL, LIFT])
def test_an_input_that_is_held_at_one_level_again_and_again_is_clipped(channel: int) -> None:
    channels = signals()
    for begin in (2000, AT):
        channels[channel][begin : begin + 20] = PRESSURE + 1e6 if channel == RAIL else 10e-6
    _, rows = observed(channels, events_required=0)
    clipped = np.flatnonzero(rows["reason"] == Reason.INPUT_CLIPPED)
    assert AT < clipped[0] <= AT + FEWEST_REPEATS + 1
    assert clipped.size >= 16


def test_what_was_above_and_below_since_is_no_end_of_a_range() -> None:
    """A slow rail sensor repeats itself in the midst of its range."""
    channels = signals()
    for begin in (2000, AT):
        channels[RAIL][begin : begin + 20] = PRESSURE
    _, rows = observed(channels, events_required=0)
    assert not (rows["reason"] == Reason.INPUT_CLIPPED).any()


@pytest.mark.parametrize("width", [3, 5, 20])
@pytest.mark.parametrize(("channel", "value"), [(RAIL, 0.0), (RAIL, 250e6), (LIFT, 400e-6)])
def test_a_dropout_of_an_input_is_held_at_what_was_before(channel: int, value: float, width: int) -> None:
    channels = signals()
    channels[channel][AT : AT + width] = value
    _, rows = observed(channels)
    values = as_recorded(rows, channel)
    assert np.ptp(values[2000:]) < 20 * values[2000:AT].std()
    assert not rows["seat_area"].any()


@pytest.mark.parametrize("step", [0.5e6, PRESSURE], ids=["coarse", "without noise"])
def test_a_channel_is_not_frozen_where_neighbours_are_mostly_equal(step: float) -> None:
    """There many equal ones say nothing."""
    stream, rows = observed(signals(step=step))
    assert (stream.count("outliers", "bridged"), stream.count("outliers", "spikes")) == (0, 0)
    assert not rows["doubt"].any()


def test_slow_samples_are_not_filtered() -> None:
    channels = signals()
    channels[LINE][AT] += 3e6
    stream, _ = observed(channels, sample_rate=20e3)
    assert stream.count("outliers", "spikes") == 0


def test_a_needle_that_moved_while_its_lift_was_held_makes_its_event_not_valid() -> None:
    channels = signals(strokes={4500: 200})
    channels[LIFT][4480:4520] = channels[LIFT][4480]
    _, rows = observed(channels, events_required=0)
    assert Reason.INPUT_FROZEN in rows["reason"][4519:4523]
    assert not (rows["reason"][4530:4600] == Reason.INPUT_FROZEN).any()


@pytest.mark.parametrize("height", [6e-6, -6e-6, -300e-6])
@pytest.mark.parametrize("at", [4510, 4700])
def test_a_spike_of_an_open_lift_is_replaced_on_its_ramp_and_at_the_stop(at: int, height: float) -> None:
    clean, spiked = (signals(strokes={4500: stroke(300, ramp=40)}) for _ in range(2))
    spiked[LIFT][at : at + 2] += height
    _, rows = observed(spiked)
    _, wanted = observed(clean)
    assert bridged(rows, LIFT) == [at, at + 1]
    assert np.abs(rows["needle_lift"] - wanted["needle_lift"]).max() < 6 * NOISE.needle_lift


@pytest.mark.parametrize("at", [4538, 4539, 4540])
def test_a_dropout_where_the_needle_turns_parts_no_injection(at: int) -> None:
    channels = signals(strokes={4500: stroke(80, ramp=40)})
    channels[LIFT][at : at + 2] = 0.0
    _, rows = observed(channels)
    assert bridged(rows, LIFT) == [at, at + 1]


@pytest.mark.parametrize("ramp", [5, 20, 40])
def test_the_corners_of_a_stroke_are_no_spikes(ramp: int) -> None:
    channels = signals(strokes={4500: stroke(2 * ramp), 4900: stroke(300, ramp=ramp)})
    _, rows = observed(channels)
    assert bridged(rows, LIFT) == []


@pytest.mark.slow
@pytest.mark.parametrize("samples", [1, 9])
def test_outliers_do_not_depend_on_what_a_frame_carries_when_events_are_judged(samples: int) -> None:
    """Noise levels change at a judgement: the samples inspected after it are the same ones."""
    count = 9000
    wanted, rows = (_disturbed_events(count, piece) for piece in (count, samples))
    for name in ("x_tilde", "innovation", "rail_pressure", "needle_lift", "doubt", "bridged", "valid", "reason"):
        assert np.array_equal(rows[name], wanted[name]), name
    assert (wanted["bridged"] > 0).sum() > 70


def _disturbed_events(count: int, piece: int) -> NDArray[np.void]:
    """Events with spikes and a frozen stretch, fed so many samples at a time; judged and learned from on the way."""
    rail, lift, line = signals(count, seed=4, strokes={1500: 100, 5000: 100})
    rng = np.random.default_rng(6)
    for at in range(200, count - 20, 50):
        (rail, line)[int(rng.integers(2))][at] += rng.normal() * 8 * NOISE.rail_pressure
    line[2510:2540] = line[2510]
    stream = Stream(learning=True, durations=Durations(event_gap=5e-3, learning_delay=8e-3))
    for k in range(0, count, piece):
        part = slice(k, k + piece)
        stream.feed(rail[part], lift[part], line[part])
    assert len([each for each in stream.outcomes if each is not None]) > 0
    return stream.finish().rows


HELD = slice(4510, 4522)  # on the way up


def held_ahead_of_noise(part: slice) -> list[NDArray[np.float64]]:
    """An opening of 2 ms whose lift is held for a while, with noise on it."""
    channels = signals()
    way = np.clip(np.minimum(np.arange(200), np.arange(200)[::-1]) * 9e-6, 0.0, 300e-6)
    motion = np.zeros(COUNT)
    motion[4500:4700] = way
    motion[part] = motion[part.start]
    channels[LIFT] += motion
    return channels


def test_a_lift_held_ahead_of_its_noise_makes_its_event_not_valid() -> None:
    _, rows = observed(held_ahead_of_noise(HELD), events_required=0)
    frozen = np.flatnonzero(rows["reason"] == Reason.INPUT_FROZEN)
    assert frozen.size == 1
    assert HELD.stop <= frozen[0] < HELD.stop + 6


@pytest.mark.parametrize(
    ("held", "spike"), [((4560, 4620), 0), ((4300, 4480), 0), *(((4510, 4511), at) for at in (0, 4300, 4600, 4510))]
)
def test_one_held_where_the_needle_does_not_move_is_none_nor_is_a_spike(held: tuple[int, int], spike: int) -> None:
    channels = held_ahead_of_noise(slice(*held))
    channels[LIFT][spike : spike + 3] += 60e-6 if spike else 0.0
    _, rows = observed(channels, events_required=0)
    assert not (rows["reason"] == Reason.INPUT_FROZEN).any()


def first_event(channels: list[NDArray[np.float64]]) -> np.void:
    stream, _ = observed(channels, events_required=0)
    event: np.void = stream.observer.events[0]
    return event


@pytest.mark.parametrize("held", [slice(4850, 4920), slice(4850, 5150)])
def test_a_lift_held_at_rest_spoils_no_event(held: slice) -> None:
    channels = signals(strokes={4500: 200})
    channels[LIFT][held] = channels[LIFT][held.start]
    event = first_event(channels)
    assert event["learnable"]
    assert event["fault"] == 0
    channels[LINE][held] = channels[LINE][held.start]
    assert first_event(channels)["fault"] == Reason.INPUT_FROZEN


@pytest.mark.parametrize(("since", "is_spoiled"), [(26, False), (8, True)])
def test_a_lift_held_high_up_limits_no_flow(since: int, is_spoiled: bool) -> None:
    """After some openings have shown where the stop is; 30 samples lead there."""
    count, last = 16_000, 14_500
    channels = signals(count)
    motion = lift_with(count, dict.fromkeys(range(2500, count, 3000), stroke(200, ramp=30)))
    motion[last + since : last + since + 12] = motion[last + since]
    channels[LIFT] += motion
    _, rows = observed(channels, events_required=0)
    assert (rows["reason"][last:] == Reason.INPUT_FROZEN).any() == is_spoiled
