"""What learning remembers from event to event goes through a file and back, as far as there is use for it."""

import json
from collections import deque
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.engine.learning.memory import Remembered, Tracker
from observer_rt.engine.stream.state import Reason


@dataclass(frozen=True)
class Level:
    pressure: float
    reason: Reason | None


class Inner(Tracker):
    count: int

    def __init__(self) -> None:
        self.count = 0


class Outer(Tracker):
    sums: NDArray[np.float64]
    levels: deque[Level]
    inner: Inner

    def __init__(self, width: int = 3) -> None:
        self.sums = np.zeros(width)
        self.levels = deque(maxlen=2)
        self.inner = Inner()
        self.interval = 1e-5  # not annotated: of this run only


def through_a_file(memory: Remembered) -> Remembered:
    return dict(json.loads(json.dumps(memory, allow_nan=False, default=np.ndarray.tolist)))


finite = st.floats(allow_nan=False, allow_infinity=False)


@given(
    sums=st.lists(finite, min_size=3, max_size=3),
    levels=st.lists(st.builds(Level, finite, st.none() | st.sampled_from(Reason)), max_size=4),
    count=st.integers(0, 1 << 40),
)
def test_what_goes_through_a_file_comes_back_to_the_bit(
    sums: list[float], levels: list[Level], count: int
) -> None:
    outer = Outer()
    outer.sums, outer.inner.count = np.array(sums), count
    outer.levels.extend(levels)
    found = Outer()
    found.recall(through_a_file(outer.memory()))
    assert found.sums.tobytes() == outer.sums.tobytes()
    assert found.levels == outer.levels
    assert found.levels.maxlen == 2
    assert found.inner.count == count


def test_what_is_remembered_does_not_change_with_what_comes_after() -> None:
    outer = Outer()
    memory = outer.memory()
    outer.sums += 1.0
    outer.levels.append(Level(1.0, None))
    assert through_a_file(memory) == through_a_file(Outer().memory())


@pytest.mark.parametrize(
    "change",
    [
        {"sums": [1.0, 2.0]},
        {"sums": "x"},
        {"levels": [{"pressure": "high"}]},
        {"levels": 3},
        {"sums": [[1.0], 2.0]},
    ],
)
def test_a_tracker_takes_back_all_or_nothing(change: Remembered) -> None:
    outer = Outer()
    outer.sums += 5.0
    found = Outer()
    found.recall({**outer.memory(), **change})
    assert through_a_file(found.memory()) == through_a_file(Outer().memory())


def test_of_another_version_it_keeps_what_it_knows() -> None:
    outer = Outer()
    outer.inner.count = 7
    found = Outer()
    found.recall({"inner": outer.inner.memory(), "of_a_later_version": 3.0})
    assert found.inner.count == 7


def test_what_is_not_finite_is_not_remembered() -> None:
    outer = Outer()
    outer.sums[1] = np.nan
    assert outer.memory() == {}
