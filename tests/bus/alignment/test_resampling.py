"""Samples between those of the grid, or further apart: straight lines between neighbours, but lifts stay."""

from collections.abc import Callable, Iterable

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from observer_rt.bus.alignment import is_stale, make_alignment
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.bus.mapping.timing import GridRelation
from observer_rt.config.signals import Role
from observer_rt.core.frames.frames import MAX_INPUTS, SLOTS, decide_samples, follow_grid, place_samples, store_value
from observer_rt.core.stream.stream import Break
from tests.bus.alignment.alignment_driver import CLOSED_LIFT, LIFT, Row, empty_ring, take_rows

RAIL = ROLES.index(Role.RAIL_PRESSURE)
GRID, FOLLOWER = 0, 1
FULL_RATE = GridRelation(1 << RAIL, 1.0, 3.0, False)
LIFT_ALONE = GridRelation(1 << LIFT, 1.0, 3.0, False)
SLOW = GridRelation(1 << RAIL, 20.0, 50.0, True)


def line(position: float) -> float:
    """A rail pressure that is linear in time, so that interpolation is exact."""
    return 50e6 + 1e3 * position


class JoinedStreams:
    def __init__(self, relation: GridRelation) -> None:
        self._alignment = make_alignment([None, relation], CLOSED_LIFT, empty_ring())
        self._roles = relation.roles
        self.rows: list[Row] = []

    def is_stale(self) -> bool:
        return is_stale(self._alignment)

    def grid(self, start: int, count: int = 1) -> None:
        _, first = place_samples(self._alignment, GRID, start, count, True)
        for index in range(first, first + count):
            for role in range(MAX_INPUTS):
                if not (self._roles >> role) & 1:
                    store_value(self._alignment, index, role, 1e-7)
        self._take()

    def rails(self, positions: Iterable[float], value: Callable[[float], float] = line) -> None:
        self._follow(RAIL, positions, value)

    def lifts(self, positions: Iterable[float], lift: Callable[[float], float]) -> None:
        self._follow(LIFT, positions, lift)

    def _follow(self, role: int, positions: Iterable[float], value: Callable[[float], float]) -> None:
        for position in positions:
            values = np.full(MAX_INPUTS, np.nan)
            values[role] = value(position)
            follow_grid(self._alignment, FOLLOWER, position, values)
            self._take()

    def _take(self) -> None:
        decide_samples(self._alignment)
        take_rows(self._alignment, self.rows)

    @property
    def indices(self) -> list[int]:
        return [row.index for row in self.rows]

    def are_on_the_line(self) -> bool:
        return all(row.values[RAIL] == pytest.approx(line(row.index), rel=1e-12) for row in self.rows)


@given(st.floats(-0.9, 0.9), st.floats(0.99, 1.01), st.integers(1, 28))
def test_another_clock_is_interpolated(phase: float, step: float, block: int) -> None:
    joined = JoinedStreams(FULL_RATE)
    positions = phase + step * np.arange(300)
    for start in range(0, 280, block):
        joined.grid(start, block)
        joined.rails(positions[start : start + block])
    assert joined.indices == list(range(joined.indices[0], joined.indices[-1] + 1))
    assert len(joined.rows) > 250
    assert joined.are_on_the_line()
    assert not any(row.interpolated for row in joined.rows)


@pytest.mark.parametrize("missing", [1, 2])
def test_a_few_missing_are_bridged_and_marked(missing: int) -> None:
    joined = JoinedStreams(FULL_RATE)
    joined.grid(0, 40)
    joined.rails([*np.arange(0.5, 20.0), *np.arange(20.5 + missing, 39.0)])
    assert joined.indices == list(range(1, 39))
    assert joined.are_on_the_line()
    assert [row.index for row in joined.rows if row.interpolated] == [20 + k for k in range(missing + 1)]


def test_more_missing_are_a_loss() -> None:
    joined = JoinedStreams(FULL_RATE)
    joined.grid(0, 40)
    joined.rails([*np.arange(0.5, 20.0), *np.arange(23.5, 39.0)])
    assert 21 not in joined.indices
    assert [row.broken for row in joined.rows if row.index == 24] == [Break.LOSS]
    assert joined.are_on_the_line()


def test_slower_signal_is_interpolated_between_its_neighbours() -> None:
    joined = JoinedStreams(SLOW)
    for position in (3.0, 23.0, 43.5, 63.0):
        joined.grid(round(position) // 20 * 20, 20)
        joined.rails([position])
    assert joined.indices == list(range(3, 64))
    assert joined.are_on_the_line()
    assert not any(row.interpolated for row in joined.rows)


def test_slower_signal_is_held_as_long_as_stated_and_then_missing() -> None:
    joined = JoinedStreams(SLOW)
    joined.rails([0.0, 20.0])
    joined.grid(0, 70)
    assert joined.indices[-1] == 20
    joined.grid(70, 10)
    assert joined.indices == list(range(71))  # 50 beyond the last
    assert {row.values[RAIL] for row in joined.rows if row.index > 20} == {line(20.0)}
    assert all(row.interpolated == (row.index > 20) for row in joined.rows)
    assert joined.is_stale()
    joined.rails([120.0, 140.0])
    joined.grid(80, 80)
    assert not joined.is_stale()
    assert [row.broken for row in joined.rows if row.index == 120] == [Break.LOSS]
    assert not set(range(71, 120)) & set(joined.indices)


def test_follower_that_stays_away_is_told_and_comes_back() -> None:
    joined = JoinedStreams(FULL_RATE)
    joined.grid(0, 20)
    joined.rails(np.arange(0.0, 20.0))
    end = 600 * 20
    for start in range(20, end, 20):
        joined.grid(start, 20)
    assert joined.is_stale()
    assert joined.indices == list(range(20))
    joined.rails(np.arange(end - 20.0, end + 19.0))
    joined.grid(end, 20)
    assert not joined.is_stale()
    assert joined.indices[20:] == list(range(end, end + 19))
    assert joined.are_on_the_line()


def test_follower_that_begins_late_starts_the_stream() -> None:
    """While its clock is not known nothing waits for ever, nor is anything made up."""
    joined = JoinedStreams(FULL_RATE)
    for start in range(0, 2 * SLOTS, 16):
        joined.grid(start, 16)
    assert joined.rows == []
    joined.rails(np.arange(2 * SLOTS - 8.25, 2 * SLOTS - 1.0))
    assert joined.indices == list(range(2 * SLOTS - 8, 2 * SLOTS - 1))
    assert joined.rows[0].broken is Break.START


def test_samples_out_of_order_far_ahead_or_without_value_are_left_out() -> None:
    joined = JoinedStreams(FULL_RATE)
    joined.grid(0, 30)
    joined.rails([0.0, 1.0, 0.5, 1.0, 2.0])
    joined.rails([30.0 + SLOTS])
    joined.rails([3.0], lambda _: np.nan)
    joined.rails([3.0], lambda _: 1e300)
    joined.rails([4.0, 5.0])
    assert joined.indices == [0, 1, 2, 3, 4, 5]
    assert joined.are_on_the_line()
    assert [row.index for row in joined.rows if row.interpolated] == [3, 4]


def needle(position: float) -> float:
    """Lift [m] that opens at 120.37 and is closed at 221.9, with corners between samples."""
    return float(np.interp(position, [120.37, 131.2, 208.1, 221.9], [0.0, 3e-4, 3e-4, 0.0]))


# The needle moves for 101 samples, in which clocks may drift by a tenth of one.
@given(st.floats(-0.9, 0.9), st.floats(0.99905, 1.00095), st.integers(1, 28))
@example(0.5234375, 0.999, 1)
def test_lifts_of_another_clock_are_kept_with_their_times(phase: float, step: float, block: int) -> None:
    """Every sample has a lift that was taken as it says, each lift of an open needle belongs to one sample."""
    joined = JoinedStreams(LIFT_ALONE)
    positions = phase + step * np.arange(300)
    for start in range(0, 280, block):
        joined.grid(start, block)
        joined.lifts(positions[start : start + block], needle)
    assert joined.indices == list(range(joined.indices[0], joined.indices[-1] + 1))
    assert len(joined.rows) > 250
    assert not any(row.interpolated for row in joined.rows)
    assert all(0.0 <= row.lift_after <= 1.0 for row in joined.rows)
    taken = np.array([row.index + row.lift_after for row in joined.rows])
    lifts = np.array([row.values[LIFT] for row in joined.rows])
    is_open = (positions > 121.0) & (positions < 221.0)
    kept = {needle(position) for position in positions[is_open]}
    assert kept <= set(lifts)
    largest_drift = 110 * abs(step - 1.0)  # while the needle moves
    for position, lift in zip(taken, lifts, strict=True):
        if lift in kept and lift < 3e-4:
            assert np.abs(positions - position).min() <= largest_drift + 1e-9


def test_lift_that_misses_samples_is_bridged_and_marked() -> None:
    joined = JoinedStreams(LIFT_ALONE)
    joined.grid(0, 260)
    joined.lifts([*np.arange(0.25, 126.0), *np.arange(128.25, 259.0)], needle)
    bridged = [row for row in joined.rows if row.interpolated]
    assert [row.index for row in bridged] == [126, 127]
    assert [row.values[LIFT] for row in bridged] == pytest.approx([needle(i + 0.25) for i in (126, 127)])
    assert {row.lift_after for row in joined.rows} == {0.25}


def test_means_on_the_grid_count_half_a_sample_before() -> None:
    """Rail pressure and lift of one message with the line pressure, whose samples are means."""
    alignment = make_alignment(
        [GridRelation(1 << RAIL | 1 << LIFT, 1.0, 3.0, False, 0.5, True)], CLOSED_LIFT, empty_ring()
    )
    values = np.zeros(MAX_INPUTS)
    for start in range(0, 60, 5):
        place_samples(alignment, 0, start, 5, True)
        for index in range(start, start + 5):
            store_value(alignment, index, ROLES.index(Role.LINE_PRESSURE), 1e6 + index)
            values[RAIL], values[LIFT] = line(index - 0.5), 1e-6 * index
            follow_grid(alignment, 0, index - 0.5, values)
        decide_samples(alignment)
    rows = alignment.recorded[: int(alignment.memory[0]["decided"])]
    assert [row["index"] for row in rows] == list(range(59))  # the last one waits for the next
    for row in rows:
        index = int(row["index"])
        rail, lift, pressure = (
            row["values"][ROLES.index(role)] for role in (Role.RAIL_PRESSURE, Role.NEEDLE_LIFT, Role.LINE_PRESSURE)
        )
        assert (rail, pressure) == (pytest.approx(line(index), rel=1e-12), 1e6 + index)
        assert (lift, row["shares"][LIFT]) == (pytest.approx(1e-6 * (index + 1)), 0.5)
        assert not row["interpolated"]


def test_samples_that_wait_for_a_message_of_the_grid_are_told() -> None:
    alignment = make_alignment([None, None], CLOSED_LIFT, empty_ring())
    place_samples(alignment, 1, 0, 1, True)
    for start in range(SLOTS // 2 + 2):
        place_samples(alignment, 0, start, 1, True)
        decide_samples(alignment)
        assert is_stale(alignment) == (start > SLOTS // 2)
