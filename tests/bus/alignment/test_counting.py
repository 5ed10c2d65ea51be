"""Frames without an index get the numbers they were sent with, or the count says that it does not know."""

from enum import IntEnum

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.core.frames.frames import Numbering, time_frame
from observer_rt.engine.stream.state import Doubt
from tests.bus.alignment.alignment_driver import keeping_of

EPOCH = 1_700_000_000_000_000_000  # ns
CYCLE = 100e-6  # s
FRAMES = 20_000


class Count(IntEnum):
    NEXT = 0
    REPEATED = 1
    OLD = 2  # overtaken by a later one
    ANEW = 3  # it fits nothing counted so far


class Counter:
    """Counts as the service does; `numbers` and `sure` of the frames it took."""

    def __init__(self, modulus: int) -> None:
        self.modulus = modulus
        self.numbers: list[int] = []
        self.sent: list[int] = []
        self.sure: list[bool] = []
        self.anew: list[int] = []
        self.dropped: list[Count] = []
        self._keeping = keeping_of(Numbering.STAMPS if modulus == 1 else Numbering.COUNTER, CYCLE, modulus=modulus)

    def take(self, number: int, come: float) -> None:
        outcome, doubt = time_frame(self._keeping, 0, number % self.modulus, -1, EPOCH + round(come * 1e9))
        if outcome in (Count.REPEATED, Count.OLD):
            self.dropped.append(Count(outcome))
            return
        counted = int(self._keeping.counts["number"][0])
        if counted == 0:
            self.anew.append(len(self.numbers))
        self.numbers.append(counted)
        self.sent.append(number)
        self.sure.append(doubt == Doubt.NONE)

    def take_all(self, numbers: NDArray[np.int64], come: NDArray[np.float64]) -> "Counter":
        for number, moment in zip(numbers.tolist(), come.tolist(), strict=True):
            self.take(number, moment)
        return self

    def wrong_and_sure(self) -> int:
        """Frames whose number is not right since the last new count, though it is said to be."""
        offset, wrong = None, 0
        begins = set(self.anew)
        for k, (number, sent, sure) in enumerate(zip(self.numbers, self.sent, self.sure, strict=True)):
            if k in begins:
                offset = None
            if not sure:
                continue
            offset = number - sent if offset is None else offset
            wrong += number - sent != offset
        return wrong


def sent(drift: float = 0.0, frames: int = FRAMES) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    numbers = np.arange(frames, dtype=np.int64)
    return numbers, np.asarray(numbers * CYCLE * (1.0 + drift), np.float64)


@pytest.mark.parametrize("modulus", [1, 16, 256])
@pytest.mark.parametrize("drift", [0.0, 100e-6])
@pytest.mark.parametrize("delays", ["prompt", "jitter of +-200 us", "batches of 1 ms"])
def test_nothing_lost_slips_no_cycle(modulus: int, drift: float, delays: str) -> None:
    numbers, taken = sent(drift)
    come = taken + 150e-6
    if delays == "jitter of +-200 us":
        come = np.maximum.accumulate(come + np.random.default_rng(1).uniform(0.0, 400e-6, FRAMES))
    if delays == "batches of 1 ms":
        come = np.ceil(come / 1e-3) * 1e-3
    counter = Counter(modulus).take_all(numbers, come)
    assert (counter.numbers, counter.anew) == (numbers.tolist(), [0])
    expected = modulus > 1 or delays == "prompt"  # without a counter, a loss would not be seen among such delays
    assert counter.sure[-1] == expected


@pytest.mark.slow
@settings(max_examples=20)
@given(
    st.integers(0, 1000),
    st.sampled_from([1, 16, 256]),
    st.lists(st.tuples(st.integers(9_000, FRAMES - 1), st.integers(1, 60)), min_size=1, max_size=4),
    st.floats(0.0, 600e-6),
)
def test_lost_frames_are_counted_or_the_count_is_not_sure(
    seed: int, modulus: int, losses: list[tuple[int, int]], width: float
) -> None:
    numbers, taken = sent(20e-6)
    kept = np.ones(FRAMES, np.bool_)
    for start, count in losses:
        kept[start : start + count] = False
    come = np.maximum.accumulate(taken + np.random.default_rng(seed).uniform(0.0, width, FRAMES))
    counter = Counter(modulus).take_all(numbers[kept], come[kept])
    assert counter.wrong_and_sure() == 0


@pytest.mark.parametrize(("modulus", "lost", "late"), [(16, n, 300e-6) for n in (1, 15, 16, 40)] + [(1, 1, 0.0)])
def test_losses_are_counted_by_a_nibble_and_stamps_or_by_stamps(modulus: int, lost: int, late: float) -> None:
    numbers, taken = sent()
    come = np.maximum.accumulate(taken + np.random.default_rng(2).uniform(0.0, late, FRAMES))
    kept = (numbers < 12_000) | (numbers >= 12_000 + lost)
    counter = Counter(modulus).take_all(numbers[kept], come[kept])
    assert counter.numbers == numbers[kept].tolist()
    assert counter.sure[-1]


def test_repeated_and_overtaken_frames_are_dropped() -> None:
    numbers, taken = sent()
    order, taken = numbers.copy(), taken.copy()
    order[15_000], order[15_001] = order[15_001], order[15_000]
    taken[15_000], taken[15_001] = taken[15_001], taken[15_001] + 20e-6
    counter = Counter(16).take_all(np.insert(order, 12_000, 11_999), np.insert(taken, 12_000, taken[11_999] + 2e-5))
    assert counter.dropped == [Count.REPEATED, Count.OLD]
    assert (counter.numbers, counter.anew) == ([n for n in numbers.tolist() if n != 15_000], [0])


@pytest.mark.parametrize("late", [1, 2])
@pytest.mark.parametrize("modulus", [15, 256, 1 << 16])
def test_frames_overtaken_before_the_clock_is_known_are_late(modulus: int, late: int) -> None:
    """As of USB adapters, which hand over neighbours in the wrong order: no turn of the counter is lost."""
    numbers, taken = sent(frames=1000)
    come = np.maximum.accumulate(taken + np.random.default_rng(3).uniform(0.0, 300e-6, 1000))
    for first in (0, *range(301, 990, 7)):
        numbers[first : first + late + 1] = np.roll(numbers[first : first + late + 1], -1)
    counter = Counter(modulus).take_all(numbers, come)
    assert counter.dropped == [Count.OLD] * 100
    assert (np.diff(np.subtract(counter.numbers, counter.sent)).tolist(), counter.anew) == ([0] * 899, [0])


@pytest.mark.parametrize(("modulus", "pause"), [(1 << 16, 60.0), (16, 2.0008)])
def test_pause_of_no_whole_number_of_turns_is_no_loss(modulus: int, pause: float) -> None:
    numbers, taken = sent()
    counter = Counter(modulus).take_all(numbers, np.where(numbers < 12_000, taken, taken + pause))
    assert (counter.anew, counter.numbers[12_000:]) == ([0, 12_000], list(range(8_000)))


@pytest.mark.parametrize("modulus", [1, 16, 256])
def test_device_that_begins_anew_is_never_wrong_and_sure(modulus: int) -> None:
    numbers, taken = sent(frames=50_000)
    restarted = np.where(numbers < 10_007, numbers, numbers - 10_007)
    come = taken + 150e-6 + np.where(numbers < 10_007, 0.0, 0.030237)
    counter = Counter(modulus).take_all(restarted, come)
    assert not any(counter.sure[10_007:13_000])
    assert all(counter.sure[-100:])
    assert len(counter.anew) <= 2


def test_device_that_begins_anew_before_its_clock_is_known_has_lost_nothing() -> None:
    numbers, taken = sent(frames=1000)
    counter = Counter(1 << 16).take_all(np.where(numbers < 500, 40_000 + numbers, numbers - 500), taken)
    assert counter.dropped == [Count.OLD] * 2  # not 25,536 frames within one cycle
    assert counter.anew == [0, 500]


def test_host_that_sleeps_makes_the_count_unsure() -> None:
    """All frames of 80 ms are stamped at its end, as a program does that reads them late."""
    numbers, taken = sent()
    asleep = (taken > 1.2) & (taken < 1.28)
    counter = Counter(1).take_all(numbers, np.where(asleep, 1.28, taken))
    first = int(np.flatnonzero(asleep)[0])
    assert counter.numbers[first] > first + 100  # taken for a loss, until the next one comes too early for that
    assert counter.anew == [0, first + 1]
    assert not any(counter.sure[first + 1 : first + 100])
    assert counter.numbers[-1] - counter.numbers[first + 1] == FRAMES - 1 - (first + 1)
