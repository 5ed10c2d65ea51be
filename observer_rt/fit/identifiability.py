"""Which parameters the recordings tell, how surely, and what they tell only together."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.evidence.bounded_fit import NORMAL_975, Quadratic
from observer_rt.fit.problem import Calibration
from observer_rt.fit.structures import FreeParameter

TOLD = 1.0 / 3.0  # of what was unknown before, above which a parameter is left to the file
LARGEST_SIGMA = 3.0  # of a logarithm, in an interval
_WEAK_SHARE = 0.3  # of a weak direction, from which a parameter is named in it


@dataclass(frozen=True)
class Direction:
    """An eigenvector of the information on the logarithms of the parameters: what is told together.

    sigma: standard deviation along it, inf where nothing is told; share: of each parameter, by symbol.
    """

    sigma: float
    share: tuple[tuple[str, float], ...]

    @property
    def words(self) -> str:
        """Its main parameters as a product of powers."""
        return " ".join(f"{symbol}^{share:+.2f}" for symbol, share in self.share if abs(share) > _WEAK_SHARE)


@dataclass(frozen=True, eq=False)
class Certainty:
    """What the data alone tell of the parameters, the offsets unknown.

    sigmas: of the logarithms (p,), inf where nothing is told; directions: from the best told to the worst.
    """

    free: tuple[FreeParameter, ...]
    sigmas: NDArray[np.float64]
    directions: tuple[Direction, ...]

    @property
    def untold(self) -> FreeParameter | None:
        """The parameter told worst of those that are not told."""
        shares = self.sigmas / [one.spread for one in self.free]
        worst = int(np.argmax(shares))
        return self.free[worst] if shares[worst] > TOLD else None


def certainty(calibration: Calibration, at: Quadratic, inflation: float) -> Certainty:
    """At a minimum. inflation: of the variance, where residuals are more than noise."""
    p = len(calibration.free)
    data = at.information - np.diag(calibration.prior_sigmas**-2)
    own, cross, offsets = data[:p, :p], data[:p, p:], data[p:, p:]
    marginal = own - cross @ np.linalg.pinv(offsets, hermitian=True) @ cross.T
    values, vectors = np.linalg.eigh(marginal / inflation)
    told = np.maximum(values, np.finfo(float).eps * max(float(values[-1]), 1.0))
    sigmas = np.sqrt(np.sum(vectors**2 / told, axis=1))
    directions = tuple(
        Direction(1.0 / math.sqrt(told[i]), _shares(calibration.free, vectors[:, i])) for i in range(p)[::-1]
    )
    return Certainty(calibration.free, sigmas, directions)


def _shares(free: Sequence[FreeParameter], vector: NDArray[np.float64]) -> tuple[tuple[str, float], ...]:
    main = vector[np.argmax(np.abs(vector))]
    return tuple((one.symbol, float(v * np.sign(main))) for one, v in zip(free, vector, strict=True))


def interval(value: float, sigma: float) -> tuple[float, float]:
    """95 % interval of a value whose logarithm has the standard deviation `sigma` (that of 3 for more)."""
    half = NORMAL_975 * min(sigma, LARGEST_SIGMA)
    return value * math.exp(-half), value * math.exp(half)
