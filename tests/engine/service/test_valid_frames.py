"""A rate frame that says Valid has all its samples, for a reader that knows the database only."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from observer_rt.files.replay.framing import Span, TimedFrame
from tests.daemon.end_to_end import RATE
from tests.device import RATES, Device, Traffic, later, simulated

Disturbance = Callable[[Traffic], list[TimedFrame]]
VALID_FROM = 12_000  # sample: two events were judged long before
FIRST = VALID_FROM // 9  # frame


def some_lost(traffic: Traffic) -> list[TimedFrame]:
    """One in fifty, once injections are valid."""
    is_there = np.random.default_rng(6).random(len(traffic.frames)) > 0.02
    return [frame for k, frame in enumerate(traffic.frames) if k < FIRST or is_there[k]]


def restarted(traffic: Traffic) -> list[TimedFrame]:
    """The device, in the middle of a block of rates."""
    return [*traffic.frames[:FIRST], *later(Device(traffic.bench).send(simulated()), 0.3)]


def jumped(traffic: Traffic) -> list[TimedFrame]:
    """The source sends windows, whose index jumps."""
    device = Device(traffic.bench)
    return device.send(simulated(), Span(0, 9 * FIRST), Span(9 * FIRST + 900, 15_000))


def stopped(traffic: Traffic) -> list[TimedFrame]:
    """The service, in the middle of a block of rates."""
    return traffic.frames[:FIRST]


def rates(frame: dict[str, Any]) -> list[Any]:
    """Numbers, or the reason, in words, why there are no numbers."""
    return [value for name, value in frame.items() if name.startswith("InjectionRate_")]


def is_complete(frame: dict[str, Any]) -> bool:
    return all(isinstance(rate, float) for rate in rates(frame))


@pytest.mark.parametrize("disturbance", [some_lost, restarted, jumped, stopped])
def test_a_frame_that_is_cut_short_is_not_valid(clean: Traffic, disturbance: Disturbance) -> None:
    frames: list[Any] = [
        RATE.decode(frame.payload)
        for frame in clean.run(disturbance(clean)).frames
        if frame.frame_id == RATE.frame_id
    ]
    cut = [
        not is_complete(frame) and isinstance(rates(frame)[0], float)
        for frame in frames
        if frame["SampleIndex"] >= VALID_FROM - RATES
    ]
    valid = [frame for frame in frames if frame["Valid"] == 1]
    assert any(cut)
    assert len(valid) > 10
    assert all(map(is_complete, valid))
