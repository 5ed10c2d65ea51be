"""Alignment under any sequence of faults, against a plain reference made of sets and sorting."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from observer_rt.core.stream.stream import Break
from tests.bus.alignment.alignment_driver import LIFT, ONE, THREE, WRAP, Aligner, Block, Row, value


@dataclass(frozen=True)
class ExpectedOutput:
    rows: list[Row]
    lost: int
    repeated: int
    old: int
    jumps: int


def reference(roles: Sequence[Sequence[int]], blocks: Sequence[Block]) -> ExpectedOutput:
    """What must come out, from sets and sorting alone, when the device does not restart."""
    accepted: list[list[Block]] = [[] for _ in roles]
    repeated = old = 0
    for block in blocks:
        own = accepted[block.message]
        if own and block.index == own[-1].index:
            repeated += 1
        elif own and block.index < own[-1].end:
            old += 1
        else:
            own.append(block)
    if not all(accepted):
        return ExpectedOutput([], 0, repeated, old, 0)
    at: list[dict[int, Block]] = [
        {i: block for block in own for i in range(block.index, block.end - block.missing)} for own in accepted
    ]
    begin = max(own[0].index for own in accepted)
    complete = sorted(i for i in set.intersection(*(set(have) for have in at)) if i >= begin)
    rows: list[Row] = []
    lost = jumps = 0

    def values(index: int) -> tuple[float, ...]:
        by_role = {role: value(role, index, at[m][index].is_open) for m in range(len(roles)) for role in roles[m]}
        return tuple(by_role[role] for role in range(3))

    for index in complete:
        broken = Break.NONE
        gap = index - rows[-1].index - 1 if rows else 0
        if not rows:
            broken = Break.START
        elif gap > 2:
            legal = _is_legal(accepted, at, rows[-1].index, index)
            broken = Break.JUMP if legal else Break.LOSS
            jumps += legal
            lost += 0 if legal else gap
        elif gap:
            lost += gap
            last, following = rows[-1], values(index)
            for k in range(1, gap + 1):
                share = k / (gap + 1)
                mixed = tuple(a + (b - a) * share for a, b in zip(last.values, following, strict=True))
                rows.append(Row(last.index + k, mixed, True, Break.NONE))
        rows.append(Row(index, values(index), False, broken))
    return ExpectedOutput(rows, lost, repeated, old, jumps)


def _is_legal(accepted: Sequence[Sequence[Block]], at: Sequence[dict[int, Block]], last: int, index: int) -> bool:
    for own, have in zip(accepted, at, strict=True):
        before, after = have[last], have[index]
        jumped = own.index(after) == own.index(before) + 1 and after.index > before.end
        if not (jumped and after.index == index and after.contiguous):
            return False
    lift_message = next(m for m, have in enumerate(at) if len(at) == 1 or m == LIFT)
    return not (at[lift_message][last].is_open or at[lift_message][index].is_open)


FAULTS = st.sampled_from(["none"] * 6 + ["lost", "twice", "again", "swapped"])


@st.composite
def traffic(draw: st.DrawFn, sizes: Sequence[int]) -> list[Block]:
    """Windows of blocks of several messages in order of time, each block with a fault of its own."""
    period = int(np.lcm.reduce(sizes))
    start = draw(st.sampled_from([7, WRAP - 3 * period - 5]))
    blocks: list[Block] = []
    sent = [0] * len(sizes)  # counter of every message
    received = [-1] * len(sizes)
    accepted_end = [-1] * len(sizes)
    for _ in range(draw(st.integers(1, 4))):
        length = period * draw(st.integers(1, 5))
        tail = draw(st.integers(0, min(sizes) - 1))
        is_open = draw(st.booleans()) and draw(st.booleans())
        order: list[tuple[int, int, int]] = []  # due, message, index
        for m, size in enumerate(sizes):
            starts = list(range(start, start + length, size))
            faults = [draw(FAULTS) for _ in starts]
            for k, fault in enumerate(faults):
                if fault == "swapped" and k + 1 < len(starts):
                    starts[k], starts[k + 1] = starts[k + 1], starts[k]
                    faults[k + 1] = "none"
            for k, fault in enumerate(faults):
                due = start + (k + 1) * size
                sends = {"lost": [], "twice": [starts[k]] * 2, "again": [starts[k], starts[max(0, k - 2)]]}
                order += [(due, m, index) for index in sends.get(fault, [starts[k]])]
        base = list(sent)
        for _, m, index in sorted(order, key=lambda item: item[0]):
            counter = base[m] + (index - start) // sizes[m]
            contiguous = counter == received[m] + 1
            if index >= accepted_end[m]:
                received[m], accepted_end[m] = counter, index + sizes[m]
            missing = tail if index + sizes[m] == start + length else 0
            blocks.append(Block(m, index, sizes[m], contiguous, missing, is_open))
        sent = [base[m] + length // size for m, size in enumerate(sizes)]
        start += length + draw(st.sampled_from([0, 1, 2, 3, 50, 5000, 200_000]))
    assume(all(block.index % WRAP for block in blocks))  # an old block at 0 means a restart
    return blocks


def compare(aligner: Aligner, expected: ExpectedOutput) -> None:
    # unwrapped from the first index received, which may lie behind the wrap already
    turns = aligner.indices[0] - expected.rows[0].index if aligner.rows and expected.rows else 0
    assert (turns % WRAP, aligner.indices) == (0, [row.index + turns for row in expected.rows])
    for row, right in zip(aligner.rows, expected.rows, strict=True):
        assert (row.interpolated, row.broken) == (right.interpolated, right.broken), row
        assert row.values == pytest.approx(right.values, rel=1e-12, abs=0.0)
        if not row.interpolated:
            assert row.values == right.values
    for name in ("lost", "repeated", "old", "jumps"):
        assert aligner.count(name) == getattr(expected, name), name
    assert aligner.count("restarts") == 0


@given(traffic([9]))
def test_any_faults_of_one_message(blocks: list[Block]) -> None:
    compare(Aligner(ONE).take_all(blocks), reference(ONE, blocks))


@given(traffic([4, 6, 3]))
def test_any_faults_of_three_messages_of_different_length(blocks: list[Block]) -> None:
    compare(Aligner(THREE).take_all(blocks), reference(THREE, blocks))


@given(
    st.lists(
        st.tuples(st.integers(0, 60), st.lists(st.sampled_from(["send", "send", "lose"]), max_size=60)),
        min_size=1,
        max_size=4,
    ),
    st.sampled_from([ONE, THREE]),
)
def test_any_restarts(epochs: list[tuple[int, list[str]]], roles: list[list[int]]) -> None:
    """Devices that start at 0 again and again: every sample is of one epoch, ascending within it, once."""
    aligner = Aligner(roles)
    for epoch, (_, ops) in enumerate(epochs):
        for k, op in enumerate(["send", *ops]):
            if op == "send":
                aligner.take_all(Block(m, 9 * k, 9, contiguous=False, epoch=epoch) for m in range(len(roles)))
    segments: list[list[Row]] = [[]]
    for row in aligner.rows:
        if row.broken is Break.RESTART:
            segments.append([])
        segments[-1].append(row)
    assert aligner.count("restarts") == len(segments) - 1 <= len(epochs) - 1
    for segment in segments:
        indices = [row.index for row in segment]
        assert indices == sorted(set(indices))
        for row in segment:
            of_epoch = [
                tuple(value(role, row.index, epoch=epoch) for role in range(3)) for epoch in range(len(epochs))
            ]
            assert row.values in of_epoch
