"""Learning between events: prediction error over the event's window, adoption by re-simulation."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.gain import GainSchedule, NoiseLevels, gain_schedule
from observer_rt.estimation.minimiser import minimise
from observer_rt.estimation.posterior import Belief, belief_from_information
from observer_rt.estimation.prediction_error import PredictionError, network_of
from observer_rt.estimation.predictor import Setting, Window, open_loop_error
from observer_rt.estimation.sensitivity import PARAMETERS, Parameter
from observer_rt.model.coefficients import Coefficients
from observer_rt.model.network import HIDDEN
from observer_rt.observer.standstill import Standstill
from observer_rt.observer.state import Constants

BURN_IN = 0.5e-3  # s of the window before innovations count
MAX_ITERATIONS = 8
TOLERANCE = 0.02  # of the decrement, in units of chi2: a seventh of a standard deviation
STANDSTILL_ENOUGH = 1000  # samples, for the first guess of the offset
DEAD_BAND_SIGMAS = 5.0
DEAD_BAND_FLOOR = 2.0e-6  # m

# Prior, drift per event (one sigma) and bounds of b_H, w, b_S, o (o in Pa).
_PRIOR = (0.45, 0.05, 0.4, 2.5e6)
_DRIFT = (5e-4, 1e-3, 5e-4, 2e3)
_BOUND = (0.8, 1.0, 0.8, 10e6)


class Verdict(StrEnum):
    """What came of learning from an event."""

    ADOPTED = "adopted"
    REJECTED = "rejected"  # the new phi does not lower the re-simulated output error
    FAILED = "failed"  # singular information, or no finite cost


def _per_parameter(values: tuple[float, float, float, float], pressure_scale: float) -> NDArray[np.float64]:
    b_h, w, b_s, offset = values
    return np.array([b_h, *[w] * HIDDEN, b_s, offset / pressure_scale])


def theta_bounds(pressure_scale: float) -> NDArray[np.float64]:
    """Largest admissible |theta| (PARAMETERS,); pressure_scale p_0 [Pa]."""
    return _per_parameter(_BOUND, pressure_scale)


def dead_band(lift_noise: float) -> tuple[float, float]:
    """Lift above which the needle counts as open and below which as shut again [m], from the lift noise [m]."""
    opens = max(DEAD_BAND_FLOOR, DEAD_BAND_SIGMAS * lift_noise)
    return opens, 0.5 * opens


@dataclass(frozen=True)
class Knowledge:
    """All that was learned, as one value that can be saved and restored.

    belief: about theta; in_force: theta (m,) the observer carries, 0 at start; noise: levels in use.
    """

    belief: Belief
    in_force: NDArray[np.float64]
    noise: NoiseLevels
    phi_version: int = 0
    events: int = 0  # learned from


def no_knowledge(noise: NoiseLevels, pressure_scale: float) -> Knowledge:
    """Knowledge of a new part: phi = 0 and the prior. pressure_scale p_0 [Pa]."""
    prior = Belief(np.zeros(PARAMETERS), np.diag(_per_parameter(_PRIOR, pressure_scale) ** 2))
    return Knowledge(prior, np.zeros(PARAMETERS), noise)


@dataclass(frozen=True)
class Outcome:
    """Result of learning from one event: what to carry from the adoption point on."""

    verdict: Verdict
    theta: NDArray[np.float64]  # to be in force: the new one when adopted, else the old one
    belief: Belief
    noise: NoiseLevels
    schedule: GainSchedule


class Learner:
    """Learns event after event. Pure: no clock, no thread; the caller decides where it runs."""

    def __init__(self, constants: Constants, knowledge: Knowledge) -> None:
        self._constants = constants
        self._belief = knowledge.belief
        self._noise = knowledge.noise
        self._events = knowledge.events
        self._schedule = self._gains(knowledge.noise)
        self._previous: Window | None = None

    @property
    def schedule(self) -> GainSchedule:
        """Gains for the noise levels in use."""
        return self._schedule

    @property
    def belief(self) -> Belief:
        """What is believed after the last event."""
        return self._belief

    def learn(self, window: Window, standstill: Standstill, in_force: NDArray[np.float64]) -> Outcome:
        """Update the belief from one event and decide whether its mean is adopted in place of `in_force` (m,)."""
        if standstill.noise is not None:
            self._noise = standstill.noise
            self._schedule = self._gains(standstill.noise)
        setting = self._setting()
        try:
            objective = PredictionError(
                window,
                setting,
                self._schedule.innovation_sigma,
                self._prior(standstill),
                theta_bounds(self._coefficients.pressure_scale),
                round(BURN_IN / self._constants.interval),
            )
            start, _ = objective.value_and_gradient(self._belief.mean)
            if not np.isfinite(start):
                return self._outcome(Verdict.FAILED, in_force)
            inverse = belief_from_information(self._belief.mean, objective.information).covariance
            minimum = minimise(objective, self._belief.mean, inverse, TOLERANCE, MAX_ITERATIONS)
            self._belief = belief_from_information(minimum.theta, objective.information)
        except np.linalg.LinAlgError:
            return self._outcome(Verdict.FAILED, in_force)
        self._events += 1
        adopted = self._is_better(window, setting, in_force)
        self._previous = window
        if adopted:
            return self._outcome(Verdict.ADOPTED, self._belief.mean)
        return self._outcome(Verdict.REJECTED, in_force)

    def _prior(self, standstill: Standstill) -> Belief:
        """The belief before this event; the first one takes its offset from the standstill."""
        if self._events > 0:
            drift = _per_parameter(_DRIFT, self._coefficients.pressure_scale)
            self._belief = self._belief.drifted(drift)
        elif standstill.samples >= STANDSTILL_ENOUGH:
            mean = self._belief.mean.copy()
            mean[Parameter.LINE_PRESSURE_OFFSET] = standstill.offset
            self._belief = Belief(mean, self._belief.covariance)
        return self._belief

    def _is_better(self, window: Window, setting: Setting, in_force: NDArray[np.float64]) -> bool:
        """Whether the new theta lowers the re-simulated output error over this and the previous event."""
        windows = [window] if self._previous is None else [self._previous, window]
        errors = [
            sum(
                open_loop_error(w, setting, network_of(theta), float(theta[Parameter.LINE_PRESSURE_OFFSET]))
                for w in windows
            )
            for theta in (self._belief.mean, in_force)
        ]
        return bool(errors[0] < errors[1])

    def _outcome(self, verdict: Verdict, theta: NDArray[np.float64]) -> Outcome:
        return Outcome(verdict, theta.copy(), self._belief, self._noise, self._schedule)

    def _gains(self, noise: NoiseLevels) -> GainSchedule:
        return gain_schedule(self._coefficients, noise, 1.0 / self._constants.interval)

    def _setting(self) -> Setting:
        return Setting(
            self._constants.interval,
            self._constants.substeps,
            self._coefficients,
            self._schedule.gains[-1].copy(),
        )

    @property
    def _coefficients(self) -> Coefficients:
        return self._constants.coefficients
