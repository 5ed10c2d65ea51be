"""What learning remembers from event to event goes through a file and back, as far as there is use for it."""

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.engine.stream.state import Reason
from observer_rt.foundation.records import NOT_KEPT, NotAsExpectedError, from_plain, to_plain


@dataclass(frozen=True)
class Level:
    pressure: float
    reason: Reason | None


@dataclass(frozen=True, eq=False)
class Sums:
    values: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    count: int = 0


@dataclass(frozen=True, eq=False)
class TrackedState:
    sums: Sums = field(default_factory=Sums)
    before: Sums | None = None
    levels: tuple[Level, ...] = ()
    columns: frozenset[int] = frozenset()
    of_this_run: int = field(default=0, metadata=NOT_KEPT)


def through_a_file(value: object) -> Any:
    return json.loads(json.dumps(to_plain(value), allow_nan=False, default=np.ndarray.tolist))


finite = st.floats(allow_nan=False, allow_infinity=False)
some_sums = st.builds(Sums, st.lists(finite, min_size=3, max_size=3).map(np.array), st.integers(0, 1 << 40))


@given(
    st.builds(
        TrackedState,
        some_sums,
        st.none() | some_sums,
        st.lists(st.builds(Level, finite, st.none() | st.sampled_from(Reason)), max_size=4).map(tuple),
        st.frozensets(st.integers(0, 17)),
    )
)
def test_what_goes_through_a_file_comes_back_to_the_bit(followed: TrackedState) -> None:
    result = from_plain(TrackedState, through_a_file(followed), TrackedState())
    assert result.sums.values.tobytes() == followed.sums.values.tobytes()
    assert (result.levels, result.columns) == (followed.levels, followed.columns)
    assert through_a_file(result) == through_a_file(followed)


def test_what_is_of_one_run_is_not_kept() -> None:
    assert "of_this_run" not in to_plain(TrackedState(of_this_run=3))


@pytest.mark.parametrize(
    ("change", "location"),
    [
        ({"sums": {"values": [1.0, 2.0]}}, "sums.values"),
        ({"sums": {"values": "x"}}, "sums.values"),
        ({"sums": {"values": [[1.0], 2.0]}}, "sums.values"),
        ({"sums": {"count": 1.5}}, "sums.count"),
        ({"sums": {"of_a_later_version": 3.0}}, "sums"),
        ({"levels": [{"pressure": "high", "reason": None}]}, "levels.0.pressure"),
        ({"levels": 3}, "levels"),
        ({"before": {"values": {}}}, "before.values"),
    ],
)
def test_what_is_none_of_a_field_is_named(change: dict[str, Any], location: str) -> None:
    with pytest.raises(NotAsExpectedError, match=f"^{location}: "):
        from_plain(TrackedState, through_a_file(TrackedState()) | change, TrackedState())


def test_what_an_older_file_does_not_tell_is_as_before_any_event() -> None:
    assert from_plain(TrackedState, {"sums": {"count": 7}}, TrackedState()).sums.count == 7
