"""Hypotheses: the kinds of events, a row for each kind of change, and the velocity of wear that moves on.

An augmented Kalman filter follows the velocity beside theta, from the beliefs before and after events: a random walk
without it lags half a percent behind a drift. It needs no further run of the model.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from observer_rt.engine.estimation.belief import Belief, Matrix, symmetric
from observer_rt.engine.estimation.parameters import FLOWS, SCALARS, Origin, Parameter, Theta
from observer_rt.engine.stream.state import Reason
from observer_rt.model.effective import LAG_UNIT

# Prior probability an event. Rates are not sensitive, for evidence is tens to thousands of nats: with ten times more,
# or a hundredth, 3 of 355 injections are judged otherwise. M: measured on plants that share no code with the
# observer; P: physics; I: a consequence of the noise or of Bayes' rule.
QUICK_BEGINS, QUICK_ENDS = 1 / 40, 1 / 50  # M: without, 60 of 80 valid in a drift for 76, and .53 covered for .99
CHANGES = 1 / 1000  # of a sensor; half as many small ones of nozzle and seat (M: without these, 57 for 61)
LINE_CHANGES = 1 / 3000
FLOW_CHANGES = 1 / 100  # another nozzle, or a law that phi cannot hold beside those it has; M: 71 valid for 22 of 102
REPLACED = 1 / 10000  # or all was learned wrongly; M: without, a gross fault is felt for ten events more
SHIFTS = 1 / 100  # of all a little; M: without, 17 of 26 valid for 26 where friction grows with the pressure
NOT_AS_FILED = 1 / 20  # line, lag of a sensor, delay of the lift, each by itself, at the first event; P
FAULT_BEGINS, FAULT_STAYS = 1 / 100, 0.5  # of an event
INADEQUATE_BEGINS, INADEQUATE_STAYS = 1 / 1000, 0.9  # of the model
# How far theta may have moved.
QUICKER = 8.0  # usual drifts an event, of quick wear beside its velocity; M
SPEED, TURNS = 6.0, 0.5  # usual drifts an event: prior of the velocity, and its own change; M
SHIFT = 30.0  # usual drifts, of all; M
LIFT_DELAY_CHANGE = 30e-6  # s: an amplifier, or a filter ahead of a converter; P
FILED = 0.02  # of their prior, by which line and sensors may be off where no event has said otherwise; M
NUDGE = 0.03  # of a flow: the prior as a whole pays so much for its width that it hides such a change; M
ALIKE, ALIKE_VARIANCE = 1.0, 4.0  # standard deviations of the means; ratio of the variances: in one mode, one; M

columns_of = SCALARS.columns_of
_ALIKE = np.array(columns_of(Origin.FLOW, Origin.SENSOR))
STATED = (*columns_of(Origin.LINE, Origin.VALVE), int(Parameter.SENSOR_LAG))
"""Columns that are 0 as long as injector and bench are as their files state."""


@dataclass(frozen=True, eq=False)
class Velocity:
    """Change of the two biases in an event: mean (2,), covariance with theta (m, 2), its own (2, 2)."""

    mean: Matrix
    across: Matrix
    covariance: Matrix


@dataclass(frozen=True, eq=False)
class Drift:
    """Belief about theta one event later, when its wear has moved on, and about its velocity then."""

    belief: Belief
    velocity: Velocity

    def after(self, learned: Belief) -> Velocity:
        """The velocity after the event, from which `learned` was learned about theta."""
        before, velocity = self.belief, self.velocity
        gain = velocity.across.T @ before.information
        taught = before.covariance - learned.covariance
        return Velocity(
            velocity.mean + gain @ (learned.mean - before.mean),
            learned.covariance @ gain.T,
            symmetric(velocity.covariance - gain @ taught @ gain.T),
        )


def drift_of(belief: Belief, usual: Matrix, velocity: Velocity | None, goes_on: float = 1.0) -> Drift:
    """Drift by one event; usual: standard deviations (m,); goes_on: probability that wear keeps its velocity."""
    flows = list(FLOWS)
    begun = np.diag((SPEED * usual[flows]) ** 2)
    if velocity is None:
        velocity = Velocity(np.zeros(2), np.zeros((usual.size, 2)), begun)
    else:  # the moments of the mixture of both
        spread = np.diag((TURNS * usual[flows]) ** 2) + (1.0 - goes_on) * np.outer(velocity.mean, velocity.mean)
        turned = goes_on * (velocity.covariance + spread) + (1.0 - goes_on) * begun
        velocity = Velocity(goes_on * velocity.mean, goes_on * velocity.across, turned)
    mean, across, moved = belief.mean.copy(), velocity.across.copy(), np.zeros_like(belief.covariance)
    mean[flows] += velocity.mean
    across[flows] += 0.5 * velocity.covariance
    moved[flows] = across.T
    moved[:, flows] += across
    across[flows] += 0.5 * velocity.covariance
    belief = Belief(mean, belief.covariance + moved, belief.error_covariance + moved)
    return Drift(belief, Velocity(velocity.mean, across, velocity.covariance))


class Mode(StrEnum):
    """State of the injector and its inputs after an event."""

    STEADY = "steady"  # wear drifts as usual
    QUICK = "quick"  # it moves on
    PASSING = "passing"  # an input is at fault
    LASTING = "lasting"  # the model is inadequate

    @property
    def is_good(self) -> bool:
        """Whether an event is explained, and learned from."""
        return self in (Mode.STEADY, Mode.QUICK)


STAYS = {Mode.STEADY: 0.0, Mode.QUICK: 1.0 - QUICK_ENDS, Mode.PASSING: FAULT_STAYS, Mode.LASTING: INADEQUATE_STAYS}
"""Probability that a mode goes on to the next event, whatever else may begin."""


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of event, with its prior probability and the change of theta that it brings."""

    name: str  # in reports
    mode: Mode  # after such an event
    rate: float  # prior probability that an event is of the kind
    columns: Sequence[int] = ()  # of theta that it moves
    of_prior: float = 0.0  # one sigma of the move, as a share of the prior
    drifts: float = 0.0  # one sigma, in usual drifts
    size: float = 0.0  # one sigma, as a number
    reason: Reason | None = Reason.SUDDEN_CHANGE  # of events that it explains; None: they are as believed

    def __post_init__(self) -> None:
        if self.columns and set(self.columns) <= set(SCALARS.gate.held):
            raise ValueError(f"{self.name}: events tell of none of its columns, which are held")

    def widths(self, wide: Theta, drift: Theta) -> Theta:
        """Standard deviations (m,) by which theta moves; wide, drift: of the prior, and of usual drift."""
        columns, result = list(self.columns), np.zeros_like(wide)
        result[columns] = np.hypot(np.hypot(self.of_prior * wide, self.drifts * drift), self.size)[columns]
        return result


# fmt: off
BEFORE = Kind("as before", Mode.STEADY, math.nan, reason=None)  # its rate is what the others leave
QUICK = Kind("moving on", Mode.QUICK, QUICK_BEGINS, FLOWS, drifts=QUICKER, reason=None)  # coking, in hours
CHANGED = Kind("changed", Mode.STEADY, FLOW_CHANGES, columns_of(Origin.FLOW), of_prior=1.0)  # a nozzle, a law here
NUDGED = Kind("changed a little", Mode.STEADY, 0.5 * CHANGES, FLOWS, size=NUDGE)  # a hole that closes
SENSOR_CHANGED = Kind("sensor changed", Mode.STEADY, CHANGES, columns_of(Origin.SENSOR), of_prior=1.0,
                      reason=Reason.PRESSURE_OFFSET)  # or its lag: whichever moved more
LINE_CHANGED = Kind("line changed", Mode.STEADY, LINE_CHANGES, columns_of(Origin.LINE, Origin.VALVE), of_prior=1.0,
                    reason=Reason.MODEL_INADEQUATE)  # another pipe, air in it, another pilot valve
LIFT_LATE = Kind("lift late", Mode.STEADY, CHANGES, columns_of(Origin.LIFT), size=LIFT_DELAY_CHANGE / LAG_UNIT,
                 reason=Reason.LIFT_SENSOR_LAG)  # or early: a filter, another clock
NEEDLE_CHANGED = Kind("needle changed", Mode.STEADY, CHANGES, columns_of(Origin.NEEDLE), of_prior=1.0)  # or its drive
OTHER_INJECTOR = Kind("another injector", Mode.STEADY, REPLACED, columns_of(*Origin), of_prior=1.0)  # or all is wrong
SHIFTED = Kind("shifted a little", Mode.STEADY, SHIFTS, columns_of(Origin.FLOW, Origin.SENSOR, Origin.LINE),
               drifts=SHIFT, reason=None)  # the model, from one operating point to another
AT_FAULT = Kind("at fault", Mode.PASSING, FAULT_BEGINS, reason=Reason.CONTRADICTED)  # nothing is learned
INADEQUATE = Kind("model inadequate", Mode.LASTING, INADEQUATE_BEGINS, reason=Reason.MODEL_INADEQUATE)
# fmt: on
NEW = (CHANGED, NUDGED, SENSOR_CHANGED, LINE_CHANGED, LIFT_LATE, NEEDLE_CHANGED, SHIFTED, OTHER_INJECTOR)
NEW_AT_FIRST = (SENSOR_CHANGED, LINE_CHANGED, LIFT_LATE)
BELIEVED = (BEFORE, QUICK, SHIFTED)
"""Kinds of events that came as something believed of the injector said."""
UNLIKE_BEFORE = (CHANGED, OTHER_INJECTOR)
"""Kinds of events after which what other operating points showed of the flow is not known to hold."""


def transitions(mode: Mode, is_prior: bool, has_lift: bool) -> Iterator[tuple[Kind, float]]:
    """Kinds of the next event and their probabilities; is_prior: nothing learned yet; has_lift: it is recorded."""
    begins = {QUICK: QUICK.rate, AT_FAULT: AT_FAULT.rate, INADEQUATE: INADEQUATE.rate}
    stays, of_fault = STAYS[mode], AT_FAULT.rate + INADEQUATE.rate
    if mode is Mode.QUICK:
        begins[QUICK] = stays * (1.0 - of_fault - sum(kind.rate for kind in NEW))
    else:
        begins = {kind: (1.0 - stays) * rate + (kind.mode is mode) * stays for kind, rate in begins.items()}
    if is_prior:
        del begins[QUICK]
        begins |= dict.fromkeys(NEW_AT_FIRST, NOT_AS_FILED * (1.0 - stays))
    else:
        begins |= {kind: kind.rate for kind in NEW}
    begins.pop(NEEDLE_CHANGED if has_lift else LIFT_LATE, None)
    yield BEFORE, max(1.0 - sum(begins.values()), 1e-3)
    yield from begins.items()


def is_alike(first: Belief, second: Belief) -> bool:
    """Whether two beliefs say the same of injector and sensor, with about the same certainty."""
    ratios = [first.covariance[column, column] / second.covariance[column, column] for column in FLOWS]
    if not all(1.0 / ALIKE_VARIANCE < ratio < ALIKE_VARIANCE for ratio in ratios):
        return False
    least = np.minimum(first.covariance.diagonal(), second.covariance.diagonal())
    return bool(np.all(((first.mean - second.mean) ** 2 <= ALIKE**2 * least)[_ALIKE]))
