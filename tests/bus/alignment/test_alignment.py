"""Alignment by sample index: named cases of every rule. Any sequence of faults: `test_alignment_faults`."""

import numpy as np
import pytest

from observer_rt.foundation.continuity import Break
from tests.bus.alignment.alignment_driver import ONE, THREE, WRAP, Aligner, Block, Placing, value


def one(*starts: int, count: int = 9) -> list[Block]:
    return [Block(0, start, count) for start in starts]


def three(*starts: int, count: int = 4) -> list[Block]:
    return [Block(message, start, count) for start in starts for message in range(3)]


def test_contiguous_blocks_pass_unchanged() -> None:
    aligner = Aligner(ONE).take_all(one(100, 109, 118))
    assert aligner.indices == list(range(100, 127))
    assert aligner.breaks == {100: Break.START}
    assert all(row.values == tuple(value(role, row.index) for role in range(3)) for row in aligner.rows)
    assert aligner.count("lost") == 0


def test_three_messages_are_joined_by_index() -> None:
    """Blocks of different length, as they come: a sample is handed on when all three have it."""
    aligner = Aligner(THREE)
    aligner.take_all([Block(0, 0, 12), Block(1, 0, 4)])
    assert aligner.indices == []
    aligner.take(Block(2, 0, 6))
    assert aligner.indices == [0, 1, 2, 3]
    aligner.take_all([Block(1, 4, 4), Block(2, 6, 6), Block(1, 8, 4)])
    assert aligner.indices == list(range(12))
    assert all(row.values == tuple(value(role, row.index) for role in range(3)) for row in aligner.rows)


def test_messages_that_start_apart_begin_together() -> None:
    aligner = Aligner(THREE).take_all([Block(0, 8, 4), Block(1, 4, 4), Block(2, 0, 4)])
    aligner.take_all([Block(1, 8, 4), Block(2, 4, 4), Block(2, 8, 4)])
    assert aligner.indices == [8, 9, 10, 11]
    assert aligner.breaks == {8: Break.START}


def test_loss_before_the_last_message_has_started_costs_only_itself() -> None:
    blocks = [Block(0, 0, 4), Block(0, 8, 4, contiguous=False)]
    blocks += [Block(m, start, 4) for start in (0, 4, 8) for m in (1, 2)]
    aligner = Aligner(THREE).take_all(blocks)
    assert aligner.indices == [0, 1, 2, 3, 8, 9, 10, 11]
    assert aligner.breaks == {0: Break.START, 8: Break.LOSS}


@pytest.mark.parametrize("gap", [1, 2])
def test_small_gap_is_interpolated_and_marked(gap: int) -> None:
    aligner = Aligner(ONE).take_all(one(0, 9 + gap))
    assert aligner.indices == list(range(18 + gap))
    assert aligner.breaks == {0: Break.START}
    marked = [row for row in aligner.rows if row.interpolated]
    assert [row.index for row in marked] == list(range(9, 9 + gap))
    for row in marked:  # the values are linear in the index, so interpolation is exact
        assert row.values == pytest.approx([value(role, row.index) for role in range(3)], rel=1e-12)
    assert aligner.count("lost") == gap


def test_sample_that_one_sensor_lacks_is_interpolated_for_all() -> None:
    aligner = Aligner(THREE).take_all([Block(0, 0, 4), Block(1, 0, 4, missing=2), Block(2, 0, 4), *three(4)])
    assert aligner.indices == list(range(8))
    assert [row.index for row in aligner.rows if row.interpolated] == [2, 3]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300, -2e9])
@pytest.mark.parametrize("role", range(3))
def test_value_that_means_nothing_is_missing(role: int, bad: float) -> None:
    aligner = Aligner(ONE)
    aligner.bad = {(role, 4): bad}
    aligner.take_all(one(0, 9))
    assert aligner.indices == list(range(18))
    assert [row.index for row in aligner.rows if row.interpolated] == [4]
    assert aligner.rows[4].values == pytest.approx([value(r, 4) for r in range(3)], rel=1e-12)
    assert aligner.count("lost") == 1


@pytest.mark.parametrize("gap", [3, 9, 90, 5000, 1_000_000])
def test_large_gap_is_a_loss(gap: int) -> None:
    blocks = one(0, 9 + gap)
    aligner = Aligner(ONE).take_all([blocks[0], Block(0, 9 + gap, 9, contiguous=False)])
    assert aligner.indices == [*range(9), *range(9 + gap, 18 + gap)]
    assert aligner.breaks == {0: Break.START, 9 + gap: Break.LOSS}
    assert aligner.count("lost") == gap


def test_block_lost_in_one_message_is_lost_for_all() -> None:
    blocks = [block for block in three(0, 4, 8) if (block.message, block.index) != (1, 4)]
    aligner = Aligner(THREE).take_all(blocks)
    assert aligner.indices == [0, 1, 2, 3, 8, 9, 10, 11]
    assert aligner.breaks == {0: Break.START, 8: Break.LOSS}
    assert aligner.count("lost") == 4


def test_silent_message_holds_the_others_back_and_comes_again() -> None:
    """One message is silent for longer than anything can be stored: lost, counted, and on it goes."""
    aligner = Aligner(THREE).take_all(three(0, 4))
    for start in range(8, 10_000, 4):
        aligner.take_all([Block(0, start, 4), Block(1, start, 4)])
    assert aligner.indices == list(range(8))
    aligner.take(Block(2, 9996, 4, contiguous=False))
    aligner.take_all(three(10_000, 10_004))
    assert aligner.indices == [*range(8), *range(9996, 10_008)]
    assert aligner.breaks == {0: Break.START, 9996: Break.LOSS}
    assert aligner.count("lost") == 9988


def test_repeated_block_changes_nothing_the_first_wins() -> None:
    aligner = Aligner(ONE).take_all(one(0, 9))
    assert aligner.take(Block(0, 9, 9, epoch=1)) is Placing.REPEATED
    aligner.take_all(one(18))
    assert aligner.indices == list(range(27))
    assert all(row.values == tuple(value(role, row.index) for role in range(3)) for row in aligner.rows)
    assert aligner.count("repeated") == 1


def test_older_block_is_dropped_and_counted() -> None:
    aligner = Aligner(ONE).take_all([Block(0, 90, 9), Block(0, 108, 9, contiguous=False)])
    assert aligner.take(Block(0, 99, 9)) is Placing.OLD
    assert aligner.indices == [*range(90, 99), *range(108, 117)]
    assert aligner.count("old") == 1
    assert aligner.count("lost") == 9


@pytest.mark.parametrize("roles", [ONE, THREE], ids=["one message", "three messages"])
@pytest.mark.parametrize("uptime", [27, 10_000, 3_000_000_006])
def test_index_back_to_zero_is_a_restart(roles: list[list[int]], uptime: int) -> None:
    """After any uptime: past 2^31 samples an index of 0 looks as if it lay ahead."""
    messages = range(len(roles))
    aligner = Aligner(roles)
    aligner.take_all(Block(m, uptime + start, 9) for start in (0, 9) for m in messages)
    placings = [aligner.take(Block(m, 0, 9, epoch=1)) for m in messages]
    assert placings[0] is Placing.RESTARTED
    aligner.take_all(Block(m, 9, 9, epoch=1) for m in messages)
    assert aligner.indices == [*range(uptime, uptime + 18), *range(18)]
    assert aligner.rows[18].broken is Break.RESTART
    assert all(
        row.values == tuple(value(role, row.index, epoch=1) for role in range(3)) for row in aligner.rows[18:]
    )
    assert aligner.count("restarts") == 1
    assert aligner.count("lost") == 0


def test_restart_whose_first_blocks_are_lost_is_seen_by_the_third() -> None:
    aligner = Aligner(ONE).take_all(one(900, 909))
    placings = [aligner.take(block) for block in one(18, 27, 36, 45)]
    assert placings == [Placing.OLD, Placing.OLD, Placing.RESTARTED, Placing.ACCEPTED]
    assert aligner.indices == [*range(900, 918), *range(36, 54)]
    assert aligner.breaks[36] is Break.RESTART


def test_scattered_old_blocks_are_no_restart() -> None:
    aligner = Aligner(ONE).take_all(one(900, 909))
    for start in (100, 300, 200, 400):
        assert aligner.take(Block(0, start, 9)) is Placing.OLD
    assert aligner.count("restarts") == 0


def test_index_wraps_round() -> None:
    """2^32 - 20 on: unwrapped, without a break."""
    start = WRAP - 20
    aligner = Aligner(THREE).take_all(three(*range(start, start + 40, 4)))
    assert aligner.indices == list(range(start, start + 40))
    assert aligner.breaks == {start: Break.START}
    assert aligner.count("lost") == 0


def test_block_lost_at_the_wrap_is_a_loss_and_no_restart() -> None:
    aligner = Aligner(ONE).take_all([Block(0, WRAP - 18, 9), Block(0, WRAP, 9, contiguous=False)])
    assert aligner.breaks == {WRAP - 18: Break.START, WRAP: Break.LOSS}
    assert aligner.count("lost") == 9


@pytest.mark.parametrize("roles", [ONE, THREE], ids=["one message", "three messages"])
@pytest.mark.parametrize("gap", [9, 5000, 100_000])
@pytest.mark.parametrize("missing", [0, 4], ids=["full", "last frame partly filled"])
def test_jump_of_a_windowed_source(roles: list[list[int]], gap: int, missing: int) -> None:
    messages = range(len(roles))
    aligner = Aligner(roles)
    aligner.take_all(Block(m, 0, 9, missing=missing) for m in messages)
    aligner.take_all(Block(m, 9 + gap, 9) for m in messages)
    assert aligner.indices == [*range(9 - missing), *range(9 + gap, 18 + gap)]
    assert aligner.breaks == {0: Break.START, 9 + gap: Break.JUMP}
    assert aligner.count("jumps") == 1
    assert aligner.count("lost") == 0


@pytest.mark.parametrize(
    ("before", "after", "contiguous"),
    [(True, False, True), (False, True, True), (False, False, False)],
    ids=["open before", "open after", "counter not contiguous"],
)
@pytest.mark.parametrize("roles", [ONE, THREE], ids=["one message", "three messages"])
def test_jump_that_is_not_legal_is_a_loss(
    roles: list[list[int]], before: bool, after: bool, contiguous: bool
) -> None:
    messages = range(len(roles))
    aligner = Aligner(roles)
    aligner.take_all(Block(m, 0, 9, is_open=before) for m in messages)
    last = len(roles) - 1
    aligner.take_all(Block(m, 109, 9, is_open=after, contiguous=contiguous or m != last) for m in messages)
    assert aligner.breaks[109] is Break.LOSS
    assert aligner.count("lost") == 100


def test_jump_in_one_message_only_is_a_loss() -> None:
    """Two messages went on: what the third leaves out is lost, whatever its counter says."""
    blocks = three(0)
    blocks += [Block(m, start, 4) for start in range(4, 40, 4) for m in (0, 1)]
    aligner = Aligner(THREE).take_all([*blocks, Block(2, 36, 4)])
    assert aligner.breaks == {0: Break.START, 36: Break.LOSS}
