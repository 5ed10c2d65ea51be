"""A Gaussian belief about the parameters, carried from event to event."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Belief:
    """Mean (m,) of theta, and how uncertain it is in two senses, both (m, m).

    covariance: with the drift that every event may bring; it decides how much the next event teaches.
    error_covariance: of the mean's error when there was no such drift, only the changes that showed. The drift is
    there to forget by and far larger than wear is from one event to the next: a filter that lives on it is up to
    sqrt(2) nearer to parameters that stand still than `covariance` says.
    """

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    error_covariance: NDArray[np.float64]

    @property
    def parts(self) -> dict[str, NDArray[np.float64]]:
        """What it consists of by name, without what was worked out of it meanwhile."""
        return {
            "mean": self.mean,
            "covariance": self.covariance,
            "error_covariance": self.error_covariance,
        }

    @property
    def sigma(self) -> NDArray[np.float64]:
        """Standard deviations (m,), drift included."""
        return np.array(np.sqrt(np.diag(self.covariance)), np.float64)

    def drifted(self, drift: NDArray[np.float64]) -> "Belief":
        """The belief one event later, when each parameter may have moved by `drift` (m,) (one sigma)."""
        return Belief(self.mean, self.covariance + np.diag(drift**2), self.error_covariance)

    def widened(self, change: NDArray[np.float64]) -> "Belief":
        """The belief when each parameter did move, by about `change` (m,) (one sigma)."""
        moved = np.diag(change**2)
        return Belief(self.mean, self.covariance + moved, self.error_covariance + moved)

    @cached_property
    def information(self) -> NDArray[np.float64]:
        """Inverse covariance (m, m). Raises numpy.linalg.LinAlgError when singular."""
        return np.asarray(np.linalg.inv(self.covariance), np.float64)

    def updated(self, information: NDArray[np.float64], vector: NDArray[np.float64]) -> "Belief":
        """The belief after measurements with Gauss-Newton `information` (m, m) and vector (m,) = information @ theta.

        theta: where the measurements' cost is least. The error after it is P (P0^-1 e0 + noise), where the noise has
        covariance `information`. Raises numpy.linalg.LinAlgError when the sum of both informations is singular, not
        positive definite or holds NaN.
        """
        before = self.information
        total = before + information
        if not np.isfinite(np.linalg.cholesky(total)).all():  # LAPACK lets NaN pass
            raise np.linalg.LinAlgError("information is not finite")
        covariance = _symmetric(np.asarray(np.linalg.inv(total), np.float64))
        kept = covariance @ before
        error = kept @ self.error_covariance @ kept.T + covariance @ information @ covariance
        return Belief(covariance @ (before @ self.mean + vector), covariance, _symmetric(error))


def prior_belief(mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> Belief:
    """Belief before any event: mean (m,), covariance (m, m)."""
    return Belief(mean, covariance, covariance)


def _symmetric(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(0.5 * (matrix + matrix.T), np.float64)
