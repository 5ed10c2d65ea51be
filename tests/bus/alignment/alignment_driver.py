"""Drives the alignment as the service does, with samples whose values tell where they belong."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment import Alignment, Timekeeping, make_alignment, make_timekeeping
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.config.signals import Role
from observer_rt.core.frames.frames import TIMING, Numbering, decide_samples, place_samples, store_value
from observer_rt.core.stream.stream import RECORDED, RECORDED_RING, Break

CLOSED_LIFT = 2e-6  # m
LIFT = ROLES.index(Role.NEEDLE_LIFT)
WRAP = 1 << 32


def keeping_of(
    numbering: Numbering, interval: float, samples: int = 1, modulus: int = 1, shortest: float = 0.0
) -> Timekeeping:
    timing = np.zeros(1, TIMING)
    timing["numbering"], timing["modulus"] = numbering, modulus
    timing["interval"], timing["shortest"] = interval, shortest
    return make_timekeeping(timing, np.array([samples]), 0)


class Placing(IntEnum):
    ACCEPTED = 0
    REPEATED = 1
    OLD = 2
    RESTARTED = 3  # accepted, as the first of a new count


def value(role: int, index: int, is_open: bool = False, epoch: int = 0) -> float:
    """A number that tells role, index and epoch; the lift of a closed needle stays below CLOSED_LIFT."""
    if role == LIFT:
        return (1e-4 if is_open else 1e-6) + 1e-14 * (index % (1 << 20)) + 1e-7 * epoch
    return 1e6 * (role + 1) + index % (1 << 20) + 0.25 * epoch


@dataclass(frozen=True)
class Row:
    index: int
    values: tuple[float, ...]
    interpolated: bool
    broken: Break
    lift_after: float = field(default=0.0, compare=False)
    """By which share of an interval its lift was taken later."""


def empty_ring() -> NDArray[np.void]:
    return np.zeros(RECORDED_RING, RECORDED)


def take_rows(alignment: Alignment, rows: list[Row]) -> None:
    decided = int(alignment.memory["decided"][0])
    for row in alignment.recorded[np.arange(len(rows), decided) % RECORDED_RING]:
        values, broken = tuple(float(v) for v in row["values"]), Break(int(row["broken"]))
        rows.append(Row(int(row["index"]), values, bool(row["interpolated"]), broken, float(row["shares"][LIFT])))


@dataclass(frozen=True)
class Block:
    """One frame's worth of samples; `index` is not wrapped, `missing` samples at its end are not available."""

    message: int
    index: int
    count: int
    contiguous: bool = True
    missing: int = 0
    is_open: bool = False
    epoch: int = 0

    @property
    def end(self) -> int:
        return self.index + self.count


@dataclass
class Aligner:
    """The alignment driven as the service does it: `roles` of each message, `bad` values of a role at an index."""

    roles: Sequence[Sequence[int]]
    rows: list[Row] = field(default_factory=list)
    bad: dict[tuple[int, int], float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._alignment = make_alignment([None] * len(self.roles), CLOSED_LIFT, empty_ring())

    def take(self, block: Block) -> Placing:
        raw = block.index % WRAP
        placing, start = place_samples(self._alignment, block.message, raw, block.count, block.contiguous)
        if placing in (Placing.ACCEPTED, Placing.RESTARTED):
            for k in range(block.count):
                for role in self.roles[block.message]:
                    number = value(role, block.index + k, block.is_open, block.epoch)
                    if k >= block.count - block.missing:
                        number = np.nan
                    number = self.bad.get((role, block.index + k), number)
                    store_value(self._alignment, start + k, role, number)
            decide_samples(self._alignment)
        take_rows(self._alignment, self.rows)
        return Placing(placing)

    def take_all(self, blocks: Iterable[Block]) -> "Aligner":
        for block in blocks:
            self.take(block)
        return self

    def count(self, name: str) -> int:
        return int(self._alignment.memory[name][0])

    @property
    def indices(self) -> list[int]:
        return [row.index for row in self.rows]

    @property
    def breaks(self) -> dict[int, Break]:
        return {row.index: row.broken for row in self.rows if row.broken is not Break.NONE}


ONE = [[0, 1, 2]]
THREE = [[0], [1], [2]]
