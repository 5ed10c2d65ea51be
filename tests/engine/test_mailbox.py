"""Verdicts as they are posted for the stream."""

import numpy as np
import pytest

from observer_rt.core.stream.stream import SLOTS
from observer_rt.engine.mailbox import has_room, post_examined
from tests.engine.sample_stream import Stream, at_rest, opened


def closed_event() -> Stream:
    """One event behind noise at rest, and before some."""
    rail, lift, line = at_rest(np.random.default_rng(5), 8000)
    return Stream().feed(rail, np.maximum(lift, opened([5000], 8000)), line).finish()


def level_at_rest(stream: Stream) -> float:
    post_examined(stream.observer, 0, (), is_coloured=True)
    return float(stream.observer.verdicts[0]["examined"]["at_rest"])


def test_samples_without_an_innovation_are_no_noise() -> None:
    stream = closed_event()
    level = level_at_rest(stream)
    assert level > 0.0
    stream.observer.ring["innovation"][::2] = 0.0  # as where the line pressure is bridged
    assert level_at_rest(stream) == pytest.approx(level, rel=0.2)


def test_there_is_room_for_as_many_verdicts_as_slots_beyond_those_taken() -> None:
    stream = closed_event()
    taken = stream.count("judgement", "events_taken")
    assert taken == 1
    assert has_room(stream.observer, taken + SLOTS - 1)
    assert not has_room(stream.observer, taken + SLOTS)
