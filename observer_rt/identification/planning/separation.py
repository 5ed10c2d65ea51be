"""Separation of rival models by a measurement that was not made yet: the -2 log L a wrong one is expected to lose.

Injections are simulated as one rival has them, without noise, and judged by the predictor of another, with the noise
of the recordings. What that could absorb by other sizes is taken off: its sizes are fitted again, jointly with what
the recordings said of them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from observer_rt.files.signals.recording import Recording
from observer_rt.identification.likelihood.bounded_fit import Range, Residuals, fit, linearise
from observer_rt.identification.likelihood.likelihood import JointLikelihood, JudgedModel, RecordingLikelihood
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.model.effective import EffectiveModel

REFITTED = 5  # iterations of a rival's sizes: it begins near
MASS_ERROR = 0.005  # standard deviation of a measured mass, as a share
RATE_NOISE = 0.5e-6  # m3/s, where no rate was measured yet


class MeasuredQuantity(StrEnum):
    """Signals of a measurement, the cheapest first: rail pressure, lift and line pressure, and what comes on top."""

    PRESSURES = "pressures and lift"
    MASS = "injected mass, too"
    RATE = "injection rate, too"


@dataclass(frozen=True, eq=False)
class Rival:
    """An explanation that is left.

    words: name it; model: with its sizes theta (p,); ranges: of these; behind: its -2 log L with the price of its
    parameters, less that of the leader.
    """

    words: str
    model: Callable[[NDArray[np.float64]], EffectiveModel]
    theta: NDArray[np.float64]
    ranges: tuple[Range, ...]
    behind: float


@dataclass(frozen=True, eq=False)
class KnownRecordings:
    """What the recordings say: of noise, and of every rival's sizes, by roots of their information (p, p)."""

    measured: Measurement
    roots: tuple[NDArray[np.float64], ...]


def known_of(
    measured: Sequence[Measurement], likelihood: JointLikelihood, rivals: Sequence[Rival]
) -> KnownRecordings:
    """What recordings say of rivals that were fitted to them."""
    return KnownRecordings(measured[0], tuple(_root(likelihood, rival) for rival in rivals))


def _root(likelihood: JointLikelihood, rival: Rival) -> NDArray[np.float64]:
    here = likelihood.residuals(rival.model(rival.theta))
    assert here is not None  # it was fitted to them
    again = linearise(lambda theta: likelihood.residuals(rival.model(theta)), rival.theta, here, rival.ranges)
    values, vectors = np.linalg.eigh(again.information)
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)


class Prospect:
    """Injections as one of the rivals has them, measured in thought."""

    def __init__(
        self, recording: Recording, truth: EffectiveModel, nominal: EffectiveModel, data: KnownRecordings
    ) -> None:
        """recording: without noise, of `truth`, injection rate and all. Raises `UserError` without an injection."""
        (measurement,) = measurements([recording])
        noise, rate_noise = data.measured.noise, data.measured.rate_noise
        rate_noise = rate_noise if np.isfinite(rate_noise) else RATE_NOISE
        self._likelihood = RecordingLikelihood(
            replace(measurement, noise=noise, rate_noise=rate_noise, stated=data.measured.stated), nominal
        )
        own = self._likelihood.judge(truth)
        if own is None:
            raise ArithmeticError("a rival has no finite solution at this operating point")
        self._own = own
        self._judged: dict[tuple[Rival, tuple[float, ...]], JudgedModel | None] = {}
        self.injections = sum(len(event.openings) for event in measurement.events)
        """Number of injections."""
        self.mass = float(np.sum(own.masses)) / self.injections
        """Injected mass of one [kg]."""

    def separation(
        self, rival: Rival, root: NDArray[np.float64], what: MeasuredQuantity, injections: int
    ) -> float:
        """Expected rise of a rival's -2 log L over that of the truth; inf where it has no solution.

        root: of the information on its sizes; injections: how many are measured.
        """
        repeats = injections / self.injections

        def absorbed(theta: NDArray[np.float64]) -> Residuals | None:
            """Of the prospect and, by their information, of the recordings."""
            judged = self._judged_at(rival, theta)
            if judged is None:
                return None
            recorded = root / np.sqrt(repeats) @ (theta - rival.theta)
            z = np.concatenate([*self._departures(judged, what, repeats), recorded])
            return Residuals(z, np.array([z.size]), np.zeros(1))

        minimum = fit(absorbed, rival.theta, rival.ranges, REFITTED)
        return np.inf if minimum is None else repeats * minimum.statistic

    def _judged_at(self, rival: Rival, theta: NDArray[np.float64]) -> JudgedModel | None:
        """A rival with these sizes, whatever is measured of it: judged once."""
        key = rival, tuple(theta.tolist())
        if key not in self._judged:
            self._judged[key] = self._likelihood.judge(rival.model(theta))
        return self._judged[key]

    def _departures(
        self, judged: JudgedModel, what: MeasuredQuantity, repeats: float
    ) -> list[NDArray[np.float64]]:
        """Normalised residuals of a model beyond those of the truth; what repetition does not lessen, as if it
        counted once in `repeats`."""
        once, own = np.sqrt(repeats), self._own
        parts = [judged.z - own.z]
        if what is MeasuredQuantity.MASS:
            share = (np.sum(judged.masses) / np.sum(own.masses) - 1.0) / MASS_ERROR
            parts.append(np.array([share / once]))
        elif what is MeasuredQuantity.RATE:
            rate = judged.rate_z - own.rate_z
            rate[-1] /= once  # its gain error
            parts.append(rate)
        return parts
