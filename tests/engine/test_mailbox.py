"""Verdicts as they are posted for the stream; what the observer remembers of its samples."""

import numpy as np
import pytest

from observer_rt.core.stream.stream import RING, SLOTS
from observer_rt.engine.mailbox import has_room, post_examined
from observer_rt.engine.observer import remembered
from tests.engine.sample_stream import Stream, at_rest, opened


def closed_event(start: int = 5000) -> Stream:
    samples = start + 3000
    rail, lift, line = at_rest(np.random.default_rng(5), samples)
    return Stream().feed(rail, np.maximum(lift, opened([start], samples)), line).finish()


def level_at_rest(stream: Stream) -> float:
    post_examined(stream.observer, 0, (), is_coloured=True)
    return float(stream.observer.verdicts[0]["examined"]["at_rest"])


def test_samples_without_an_innovation_are_no_noise() -> None:
    stream = closed_event()
    level = level_at_rest(stream)
    assert level > 0.0
    stream.observer.ring["innovation"][::2] = 0.0  # as where the line pressure is bridged
    assert level_at_rest(stream) == pytest.approx(level, rel=0.2)


def test_noise_counts_from_as_far_back_as_half_of_what_is_remembered() -> None:
    stream = closed_event(20_000)
    level = level_at_rest(stream)
    for position, is_counted in ((3000, False), (5000, True)):
        stream.observer.ring["innovation"][position : position + 500] *= 10.0
        assert (level_at_rest(stream) > 2.0 * level) == is_counted


def test_there_is_room_for_as_many_verdicts_as_slots_beyond_those_taken() -> None:
    stream = closed_event()
    taken = stream.count("judgement", "events_taken")
    assert taken == 1
    assert has_room(stream.observer, taken + SLOTS - 1)
    assert not has_room(stream.observer, taken + SLOTS)


@pytest.mark.parametrize("start", [0, RING - 4, RING - 3, RING - 2, 3 * RING - 1])
@pytest.mark.parametrize("count", [0, 1, 3, RING])
def test_samples_by_their_positions_wherever_the_ring_ends(start: int, count: int) -> None:
    taken = remembered(np.arange(RING), start, start + count).tolist()
    assert taken == [position % RING for position in range(start, start + count)]
