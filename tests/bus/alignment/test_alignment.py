"""Alignment by sample index where `test_alignment_faults` does not reach: bad values, silence, restarts."""

import numpy as np
import pytest

from observer_rt.core.stream.stream import Break
from tests.bus.alignment.alignment_driver import ONE, THREE, Aligner, Block, Placing, value


def single(*starts: int, count: int = 9) -> list[Block]:
    return [Block(0, start, count) for start in starts]


def three(*starts: int, count: int = 4) -> list[Block]:
    return [Block(message, start, count) for start in starts for message in range(3)]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300, -2e9])
@pytest.mark.parametrize("role", range(3))
def test_value_that_means_nothing_is_missing(role: int, bad: float) -> None:
    aligner = Aligner(ONE)
    aligner.bad = {(role, 4): bad}
    aligner.take_all(single(0, 9))
    assert aligner.indices == list(range(18))
    assert [row.index for row in aligner.rows if row.interpolated] == [4]
    assert aligner.rows[4].values == pytest.approx([value(r, 4) for r in range(3)], rel=1e-12)
    assert aligner.count("lost") == 1


def test_silent_message_holds_the_others_back_and_comes_again() -> None:
    """One message is silent for longer than anything can be stored: lost, counted, and on it goes."""
    aligner = Aligner(THREE).take_all(three(0, 4))
    for start in range(8, 10_000, 4):
        aligner.take_all([Block(0, start, 4), Block(1, start, 4)])
    assert aligner.indices == list(range(8))
    aligner.take(Block(2, 9996, 4, contiguous=False))
    aligner.take_all(three(10_000, 10_004))
    assert aligner.indices == [*range(8), *range(9996, 10_008)]
    assert (aligner.breaks, aligner.count("lost")) == ({0: Break.START, 9996: Break.LOSS}, 9988)


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
    assert all(row.values == tuple(value(role, row.index, epoch=1) for role in range(3)) for row in aligner.rows[18:])
    assert (aligner.count("restarts"), aligner.count("lost")) == (1, 0)


def test_restart_whose_first_blocks_are_lost_is_seen_by_the_third() -> None:
    aligner = Aligner(ONE).take_all(single(900, 909))
    placings = [aligner.take(block) for block in single(18, 27, 36, 45)]
    assert placings == [Placing.OLD, Placing.OLD, Placing.RESTARTED, Placing.ACCEPTED]
    assert aligner.indices == [*range(900, 918), *range(36, 54)]
    assert aligner.breaks[36] is Break.RESTART


def test_scattered_old_blocks_are_no_restart() -> None:
    aligner = Aligner(ONE).take_all(single(900, 909))
    for start in (100, 300, 200, 400):
        assert aligner.take(Block(0, start, 9)) is Placing.OLD
    assert aligner.count("restarts") == 0
