"""Evidence of an event for a prior, its marginal likelihood; densities of innovations beside the model's noise.

In closed form where the cost is a parabola: MacKay, Information Theory, Inference, and Learning Algorithms, chapter
28: the best fit, less what a prior pays for its width.

A model that leaves innovations a little louder, or a little coloured, is adequate: that costs it nothing. An event at
fault leaves them as loud, in some phase and over some length of blocks, as they are; the density for that is broad.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.evidence import integrate_cost
from observer_rt.engine.estimation.gating import Belief
from observer_rt.engine.estimation.phases import PHASES, PhaseStatistics
from observer_rt.engine.estimation.prediction_error import Linearisation
from observer_rt.engine.estimation.scalars import Theta
from observer_rt.engine.learning.account.constants import BEYOND, NEARLY_WHITE, NEARLY_WHITE_BLOCKS
from observer_rt.engine.learning.fitting import Limits
from observer_rt.engine.learning.healthy import Healthy

Table = NDArray[np.float64]


class Evidence(NamedTuple):
    """Logarithm of the marginal likelihood, but for what all priors share, and the mean (m,) of theta after it."""

    log: float
    theta: Theta


def evidences(cost: Linearisation, priors: Sequence[Belief], limits: Limits) -> list[Evidence]:
    """Integrates exp(-cost) over Gaussian priors, the cost a parabola round where it was linearised.

    What that promises beyond the limits, or further off than slopes hold, is fiction: no more than `BEYOND` of it
    counts. Raises numpy.linalg.LinAlgError when singular.
    """
    thetas, results = integrate_cost(cost, limits, priors)
    widths, least, allowed = results.T
    logs = -np.maximum(least, allowed - BEYOND) - widths
    return [Evidence(log, theta) for log, theta in zip(logs.tolist(), thetas, strict=True)]


def nearly_white(clipped: PhaseStatistics, temper: float, healthy: Healthy) -> float:
    """Nats by which innovations are more likely, being nearly white, by sums over clipped ones.

    temper: what events scatter beyond noise; healthy: whose innovations are louder than noise, too.
    """
    squares, count = _sums(clipped)
    squares /= temper
    usual = np.concatenate(((NEARLY_WHITE * healthy.variance)[None], NEARLY_WHITE_BLOCKS * healthy.colour.T))
    loud = np.minimum(np.maximum(squares / np.maximum(count, 1e-9), 1.0), usual)
    return float(_gain(squares, loud, count).max(axis=0).sum())


def at_fault(statistics: PhaseStatistics, temper: float) -> float:
    """Cost [nats] of an event at fault, by sums over innovations in standard deviations."""
    squares, count = _sums(statistics)
    squares /= temper
    white = 0.5 * squares[0]
    loud = np.maximum(squares / np.maximum(count, 1e-9), 1.0)
    costs = white - _gain(squares, loud, count) + 0.5 * np.log(np.maximum(count, 1.0))
    loudest = math.log(len(costs)) - np.logaddexp.reduce(-costs, axis=0)
    # as likely white as not in every phase, but not in all
    anyhow = float((math.log(2.0) - np.logaddexp(-white, -loudest)).sum())
    nowhere = float(white.sum()) + PHASES * math.log(2.0)
    return anyhow - math.log(-math.expm1(anyhow - nowhere)) + math.log1p(-(2.0**-PHASES))


def _gain(squares: Table, loud: Table, count: Table) -> Table:
    """Nats by which squares are more likely of so many numbers that are louder than noise; 0 of none."""
    return 0.5 * squares * (1.0 - 1.0 / loud) - 0.5 * count * np.log(loud)


def _sums(statistics: PhaseStatistics) -> tuple[Table, Table]:
    """Squares and how many of them, (1 + len(BLOCKS), PHASES): of samples and of blocks of every length."""
    squares = np.concatenate((statistics.squares[None], statistics.block_squares.T))
    return squares, np.concatenate((statistics.samples[None], statistics.blocks.T))
