"""A Gaussian belief about the parameters, carried from event to event."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Belief:
    """Mean (m,) and covariance (m, m) of theta."""

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]

    @property
    def sigma(self) -> NDArray[np.float64]:
        """Standard deviations (m,)."""
        return np.array(np.sqrt(np.diag(self.covariance)), np.float64)

    def drifted(self, drift: NDArray[np.float64]) -> "Belief":
        """The belief one event later, when each parameter may have moved by `drift` (m,) (one sigma)."""
        return Belief(self.mean, self.covariance + np.diag(drift**2))

    def information(self) -> NDArray[np.float64]:
        """Inverse covariance (m, m). Raises numpy.linalg.LinAlgError when singular."""
        return np.asarray(np.linalg.inv(self.covariance), np.float64)


def belief_from_information(mean: NDArray[np.float64], information: NDArray[np.float64]) -> Belief:
    """Belief with the inverse covariance `information` (m, m), symmetrised.

    Raises numpy.linalg.LinAlgError when it is singular, not positive definite or holds NaN.
    """
    if not np.isfinite(np.linalg.cholesky(information)).all():  # LAPACK lets NaN pass
        raise np.linalg.LinAlgError("information is not finite")
    covariance = np.linalg.inv(information)
    return Belief(mean, 0.5 * (covariance + covariance.T))
