"""Phases of an event, and statistics of the innovations in each of them."""

import math
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning import phases as core
from observer_rt.foundation.units import Bools, Floats

EDGE = 0.3e-3  # s after the needle leaves its seat, and before it is back on it
AFTERGLOW = 0.05e-3  # s after it is shut that still count as closing
BLOCKS = (8, 20)  # samples in a block; means of blocks show a colour that single samples hide
_BLOCKS = np.array(BLOCKS)
_FEWEST = 1e-300  # of samples or blocks, so that none is divided by 0
Sums = TypeVar("Sums", float, Floats)


class Phase(IntEnum):
    """Phase of an event to which a sample belongs."""

    STANDSTILL = core.STANDSTILL
    OPENING = core.OPENING
    OPEN = core.OPEN
    CLOSING = core.CLOSING
    AFTER = core.AFTER

    @property
    def label(self) -> str:
        """Name of the phase in the documents of a fit."""
        return self.name.lower()


PHASES = len(Phase)
PHASE_NAMES = {phase: phase.label for phase in Phase} | {Phase.STANDSTILL: "closed"}  # in findings
PHASE_WORDS = {
    Phase.STANDSTILL: "while the needle is shut",
    Phase.OPENING: "while the needle opens",
    Phase.OPEN: "while the needle is open",
    Phase.CLOSING: "while the needle closes",
    Phase.AFTER: "right after the needle has closed",
}


@dataclass(frozen=True)
class PhaseStatistics:
    """Sums of squared normalised innovations by phase, over samples and blocks; their mean is 1 for a good model."""

    squares: Floats  # (PHASES,)
    samples: Floats  # (PHASES,)
    block_squares: Floats  # (PHASES, len(BLOCKS))
    blocks: Floats  # (PHASES, len(BLOCKS))

    def faded(self, factor: float, newer: "PhaseStatistics") -> "PhaseStatistics":
        """Statistics weighted by `factor`, and newer ones added."""
        return PhaseStatistics(
            factor * self.squares + newer.squares,
            factor * self.samples + newer.samples,
            factor * self.block_squares + newer.block_squares,
            factor * self.blocks + newer.blocks,
        )

    def capped(self, deviate: float) -> "PhaseStatistics":
        """Statistics, none further from white noise than `deviate` standard deviations (see `excess`)."""
        return PhaseStatistics(
            _capped(self.squares, deviate, self.samples),
            self.samples,
            _capped(self.block_squares, deviate, self.blocks),
            self.blocks,
        )

    def relative_to(self, variance: Floats, colour: Floats) -> "PhaseStatistics":
        """Statistics with squares divided by `variance` (PHASES,) and `colour` (PHASES, len(BLOCKS))."""
        return PhaseStatistics(self.squares / variance, self.samples, self.block_squares / colour, self.blocks)

    @cached_property
    def quotients(self) -> Floats:
        """Mean squares (PHASES, 1 + len(BLOCKS)) of samples, and of scaled means of blocks; 1 without any."""
        sums, counts = self._sums
        return np.where(counts > 0.0, sums / np.maximum(counts, _FEWEST), 1.0)

    @cached_property
    def deviates(self) -> Floats:
        """`deviate` (PHASES, 1 + len(BLOCKS)) of the same sums; 0 without any."""
        sums, counts = self._sums
        return np.where(counts > 0.0, deviate(sums, np.maximum(counts, _FEWEST)), 0.0)

    @property
    def _sums(self) -> tuple[Floats, Floats]:
        sums = np.concatenate((self.squares[:, None], self.block_squares), axis=1)
        return sums, np.concatenate((self.samples[:, None], self.blocks), axis=1)

    def variance(self, phase: Phase) -> float:
        """Mean square of the normalised innovations, 1 without samples."""
        return float(self.quotients[phase, 0])

    def colour(self, phase: Phase) -> float:
        """Largest mean square of scaled block means over the block lengths, 1 without blocks."""
        return float(self.quotients[phase, 1:].max())

    def excess_beyond(self, colour: float, variance: Floats) -> Floats:
        """`excess` (PHASES,) where the colour is above a limit or the variance above one (PHASES,); 0 elsewhere."""
        quotients = self.quotients
        is_beyond = (quotients[:, 0] > variance) | (quotients[:, 1:].max(axis=1) > colour)
        return np.where(is_beyond, self.deviates.max(axis=1), 0.0)

    def excess(self, phase: Phase) -> float:
        """Standard deviations by which the largest of variance and colours exceeds white noise; 0 without samples.

        The sums of few blocks have a long tail, which a normal distribution would ignore.
        """
        return float(self.deviates[phase].max())


def no_statistics() -> PhaseStatistics:
    """Statistics before any sample."""
    return PhaseStatistics(
        np.zeros(PHASES), np.zeros(PHASES), np.zeros((PHASES, len(BLOCKS))), np.zeros((PHASES, len(BLOCKS)))
    )


def phase_statistics(
    innovations: Floats,
    sigma: float,
    phases: NDArray[np.int8],
    first: int,
    left_out: Bools | None = None,
    limit: float = math.inf,
) -> PhaseStatistics:
    """Statistics from sample `first` on of innovations (n,), clipped to `limit` sigma, without left_out (n,)."""
    result = no_statistics()
    if left_out is None:
        left_out = np.zeros(len(phases), np.bool_)
    core.sum_innovations(
        innovations[first:],
        sigma,
        limit,
        phases[first:],
        left_out[first:],
        _BLOCKS,
        result.squares,
        result.samples,
        result.block_squares,
        result.blocks,
    )
    return result


def _capped(sums: Floats, deviate: float, count: Floats) -> Floats:
    """Sums of `count` squares, at most those whose `deviate` is `deviate` (but for counts below 1)."""
    variance = 2.0 / (9.0 * np.maximum(count, 1.0))
    return np.minimum(sums, count * (1.0 - variance + deviate * np.sqrt(variance)) ** 3)


def deviate(total: Sums, count: Sums) -> Sums:
    """Normal deviate as improbable as `total`, the sum of `count` > 0 squares of standard normal numbers.

    By the cube root of Wilson and Hilferty (1931), Proc. Natl. Acad. Sci. 17, 684.
    """
    variance = 2.0 / (9.0 * count)
    deviation: Sums = (np.cbrt(total / count) - (1.0 - variance)) / np.sqrt(variance)
    return deviation
