"""What a model leaves unexplained of the healthy injector it was fitted to: what faults are measured against."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.phases import BLOCKS, PHASES, Phase, PhaseStatistics
from observer_rt.model.baseline import Baseline

EDGES = (Phase.OPENING, Phase.CLOSING)
# Mean square of single samples at an edge that a fitted model may leave: corners of the lift between samples scatter
# with flow, and injections beyond those fitted have more of it. What biases a mass shows in means of blocks.
SCATTER = 2.0
SAME_RATE = 0.01  # share by which sample rates may differ and a baseline still holds: blocks count samples


def _ones(*shape: int) -> NDArray[np.float64]:
    return np.ones(shape)


@dataclass(frozen=True, eq=False)
class Healthy:
    """Of a model as it came, nothing: its innovations are white.

    variance: (PHASES,), colour: (PHASES, len(BLOCKS)), of the innovations by phase, at least 1; mass_share: standard
    deviation of a mass, as a share, that comes of the model; adequate: whether the fitted model
    may be learned with at all.
    """

    variance: NDArray[np.float64] = field(default_factory=lambda: _ones(PHASES))
    colour: NDArray[np.float64] = field(default_factory=lambda: _ones(PHASES, len(BLOCKS)))
    mass_share: float = 0.0
    adequate: bool = True

    def relative(self, statistics: PhaseStatistics) -> PhaseStatistics:
        """Statistics of an event, measured against these."""
        return statistics.relative_to(self.variance, self.colour)


NOT_FITTED = Healthy()
"""Of a model that was not fitted to recordings."""


def healthy_of(baseline: Baseline | None, sample_rate: float, trusted: bool = False) -> Healthy:
    """What a fitted file remembers, at a sample rate [Hz]; trusted: learn with an inadequate model all the same."""
    if baseline is None:
        return NOT_FITTED
    share, adequate = baseline.mass_share, baseline.adequate or trusted
    if not holds_at(baseline, sample_rate):
        return Healthy(mass_share=share, adequate=adequate)
    names = [phase.name for phase in Phase]
    variance = np.maximum([baseline.variance.at(name) for name in names], 1.0)
    variance[list(EDGES)] = np.maximum(variance[list(EDGES)], SCATTER)
    colour = np.array([[baseline.chi2.at(name), baseline.colour.at(name)] for name in names])
    return Healthy(variance, np.maximum(colour, 1.0), share, adequate)


def holds_at(baseline: Baseline, sample_rate: float) -> bool:
    """Whether innovations at a sample rate [Hz] can be compared with a baseline's."""
    return math.isclose(baseline.sample_rate_Hz, sample_rate, rel_tol=SAME_RATE)
