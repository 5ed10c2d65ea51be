"""Adequacy of the model for an event: innovation statistics and plausibility, learned from or not.

Events are examined with the parameters in force, which sees what was judged before; no clock, no thread.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from observer_rt.core.learning.phases import phases_of
from observer_rt.engine.estimation.parameters import FLOWS, SCALARS, WEIGHTS, Parameter, Theta, sensor_lag
from observer_rt.engine.estimation.phases import AFTERGLOW, EDGE, Phase, PhaseStatistics, phase_statistics
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy, expected_in
from observer_rt.engine.learning.noise import Colour, mask_of
from observer_rt.engine.stream.state import Constants, Reason
from observer_rt.foundation.units import Floats

# Standard deviations and factor by which a pooled statistic exceeds white noise where a phase is coloured. The first
# keeps false alarms below 1e-4 an event, the second keeps very long recordings from refusing a good model.
SIGNIFICANT = 4.5
RELEVANT_COLOUR = 1.6
RELEVANT_VARIANCE = 1.15  # where the needle moves, and its lift is known
RELEVANT_LOUDNESS = 2.0  # elsewhere: what is white there is noise that has grown, or a stroke unlike the model's
TEMPER_ABOVE = 1.6  # colour beyond which an event's information counts for less, and how significant it must be
TEMPER_SIGNIFICANT = 2.5
_TEMPERS_ABOVE = np.array([RELEVANT_VARIANCE, TEMPER_ABOVE, TEMPER_ABOVE])  # blocks have two lengths
POOLING = 0.85  # weight of the statistics before this event
LARGEST_POOLED = 5.0  # standard deviations they count for at most: a passing trouble is over with the next event
LARGEST_OFFSET = 1.5e6  # Pa, between line and rail pressure
UNTOLD = 2.5  # standard deviations of what of a gain may be an offset, which is then allowed on top
LEAST_SCALE, LINE_SCALE = 0.03, 3.0  # of the logarithm of 1 + r; standard deviations of the line's inertance
LARGEST_LAG = 0.2e-3  # s
# Mean square of the network's weights over their prior, and lag [s] and friction that no such law brings along
MOST_OF_LAWS, LAG_OF_LAWS, FRICTION_OF_LAWS = 0.5, 10e-6, -0.1
CLIP = 4.0  # standard deviations for which a single innovation counts at most: an outlier is no colour
BURN_IN = 0.5e-3  # s of an event's window before innovations count
EDGES = (Phase.OPENING, Phase.CLOSING)
_BY_LIFT = np.array([RELEVANT_VARIANCE if phase in EDGES else RELEVANT_LOUDNESS for phase in Phase])
_BY_COMMANDS = np.full(len(Phase), RELEVANT_LOUDNESS)
BELIEVED_AFTER = 2  # explained events after one that was not, in a row or not; the last of them is believed
SETTLED = 3  # explained events in a row, after which one that is not is a fault that may pass


@dataclass(frozen=True)
class Objection:
    """Reason against an event, and the phase in which it shows."""

    reason: Reason
    phase: Phase | None = None


class Innovations(NamedTuple):
    """Innovations e~ (n,) of an event and their standard deviation if the model is right, both in units of p_0."""

    values: Floats
    sigma: float


def event_statistics(window: Window, innovations: Innovations, interval: float, healthy: Healthy) -> PhaseStatistics:
    """Statistics of the innovations over a window, phase by phase, against a healthy injector's; interval [s]."""
    phases = phases_of(window, round(EDGE / interval), round(AFTERGLOW / interval))
    statistics = phase_statistics(
        innovations.values, innovations.sigma, phases, round(BURN_IN / interval), mask_of(window), CLIP
    )
    return healthy.relative(statistics)


def inadequate_phase(statistics: PhaseStatistics, by_commands: bool = False) -> Phase | None:
    """The phase that contradicts the model most, None: each may be noise; by_commands: the needle goes by them."""
    excess = statistics.excess_beyond(RELEVANT_COLOUR, _BY_COMMANDS if by_commands else _BY_LIFT)
    worst = int(np.argmax(excess))
    return Phase(worst) if excess[worst] > SIGNIFICANT else None


def pooled(before: PhaseStatistics, event: PhaseStatistics) -> PhaseStatistics:
    """Statistics over recent events, the newest in full."""
    return before.capped(LARGEST_POOLED).faded(POOLING, event)


def tempering(statistics: PhaseStatistics) -> float:
    """Factor on the variance of an event's innovations: above 1 when they are coloured, or louder than believed."""
    beyond = statistics.quotients > _TEMPERS_ABOVE
    if not beyond.any():
        return 1.0
    beyond &= statistics.deviates.max(axis=1, keepdims=True) > TEMPER_SIGNIFICANT
    return float(statistics.quotients.max(initial=1.0, where=beyond))


def is_offset(offset: float, untold: float = 0.0) -> bool:
    """Whether an offset between the pressures is too large [Pa]; untold: sigma of what their gain may be of it."""
    return abs(offset) > LARGEST_OFFSET + UNTOLD * untold


def objections(
    statistics: PhaseStatistics,
    offset: float,
    lag: float,
    healthy: Healthy = NOT_FITTED,
    untold: float = 0.0,
    by_commands: bool = False,
) -> list[Objection]:
    """Objections to an event, a cause first; offset, untold [Pa], lag [s]; always if the model fits nobody."""
    result = [Objection(Reason.PRESSURE_OFFSET)] if is_offset(offset, untold) else []
    if lag > LARGEST_LAG:
        result.append(Objection(Reason.SENSOR_LAG))
    phase = inadequate_phase(statistics, by_commands)
    if phase is not None or not healthy.adequate:
        result.append(Objection(Reason.MODEL_INADEQUATE, phase))
    return result


def is_worn_beyond_limits(theta: Floats) -> bool:
    """True if theta (m,) is at a limit of nozzle or seat (no minimum), as after an opening that was none."""
    limits = ((theta[row.column], row.bounds) for row in SCALARS.rows if row.column in FLOWS)
    return any(not lowest < value < highest for value, (lowest, highest) in limits)


def is_no_law(theta: Theta, wide: Theta) -> bool:
    """True if the network learned no law of nozzle or seat; wide: standard deviations (m,) before any event.

    Line or sensor seem better than new: a late channel, a line that remembers, or an inertance that goes with the
    flow looks like a lag or less friction, and the network makes up for the rest.
    """
    square = float(np.mean((theta[WEIGHTS] / wide[WEIGHTS]) ** 2))
    is_other = sensor_lag(theta) > LAG_OF_LAWS or theta[Parameter.LINE_FRICTION] < FRICTION_OF_LAWS
    return square > MOST_OF_LAWS and bool(is_other)


def looks_like_inertance(flow_change: float, stiffness_change: float, line: float = 0.0) -> bool:
    """True if flow and r together look like another A_L/(rho_L L_L) rather than like wear and another K_L.

    Flows, 1/K_L and inertance scaled together leave p_L as it is: with the inertance off by s, a healthy injector has
    flows of s and 1 + r -> 1/s. line: share (one sigma) to which it is known, in every interval.
    """
    stiffer = -math.log1p(stiffness_change)
    wider = math.log1p(max(flow_change, -0.99))
    is_relevant = abs(stiffer) > max(LEAST_SCALE, LINE_SCALE * line)
    return is_relevant and 0.5 * abs(stiffer) < math.copysign(1.0, stiffer) * wider < 2 * abs(stiffer)


@dataclass(frozen=True, eq=False)
class Examination:
    """Objections to an event, and the statistics over recent events with it."""

    objections: tuple[Objection, ...]  # empty: it passed
    statistics: PhaseStatistics
    passed: int = 0  # events in a row that did, SETTLED at most; negative: that must until one is believed again


class Examiner:
    """Finds the objections to one event after the other, and keeps what the next is judged by."""

    def __init__(self, statistics: PhaseStatistics, healthy: Healthy, colour: Colour | None = None) -> None:
        """statistics: before the first event; colour: of the innovations then, None if white."""
        self._healthy = healthy
        self._passed = 0
        self.colour = colour
        """Colour of the innovations; replaced, as the statistics are, by what learning from an event found."""
        self.statistics = statistics
        """Over recent events; whoever learns from an event replaces them by what was found."""

    def take(self, examination: Examination) -> None:
        """Takes over how an event was judged."""
        self.statistics, self._passed = examination.statistics, examination.passed

    def examine(
        self, window: Window | None, innovations: Innovations, in_force: Theta, constants: Constants
    ) -> Examination:
        """Judges one event; `window` None: it cannot be tested; in_force (m,) and constants: during it.

        One refused by itself says nothing of later ones, but the next must pass, two where one was refused lately: a
        wrong model is not contradicted at every operating point.
        """
        if window is None:
            return Examination((Objection(Reason.NOT_JUDGED),), self.statistics, self._passed)
        if self._healthy.shape is not None:
            expected = expected_in(self._healthy.shape, window, constants.coefficients, constants.interval)
            innovations = innovations._replace(values=innovations.values - expected)
        if self.colour is not None:
            innovations = Innovations(self.colour.whitening.of(innovations.values, window.masked), self.colour.sigma)
        event = event_statistics(window, innovations, constants.interval, self._healthy)
        lag = sensor_lag(in_force)
        offset, untold = _offset(window, in_force, constants)
        by_commands = window.needle is not None
        if inadequate_phase(event, by_commands) is not None:
            raised = objections(event, offset, lag, self._healthy, untold, by_commands)
            to_pass = 1 if self._passed >= SETTLED else BELIEVED_AFTER
            return Examination(tuple(raised), self.statistics, self._passed if self._passed < 0 else -to_pass)
        statistics = pooled(self.statistics, event)
        raised = objections(statistics, offset, lag, self._healthy, untold, by_commands)
        passed = self._passed if raised else min(self._passed + 1, SETTLED)
        if passed < 0 and not raised:
            raised = [Objection(Reason.MODEL_INADEQUATE)]
        return Examination(tuple(raised), statistics, passed)


def _offset(window: Window, in_force: Theta, constants: Constants) -> tuple[float, float]:
    shut, scale = slice(0, max(window.opening, 1)), constants.coefficients.pressure_scale
    rail, gain = window.inputs[shut, 0], float(in_force[Parameter.LINE_PRESSURE_GAIN])
    difference = window.output[shut] - (1.0 + gain) * rail
    mean = float(difference.sum()) / difference.size
    untold = constants.calibration.gain if gain == 0.0 else 0.0
    return (mean - constants.sensor.offset) * scale, untold * float(rail[0]) * scale
