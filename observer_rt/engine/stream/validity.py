"""The only place where validity is decided: facts about an injection or the service give a state and a reason.

A valid result has no reason. docs/validity.md says which part knows which fact, and when.
"""

from dataclasses import dataclass

from observer_rt.engine.stream.state import Reason, State

_NOT_KNOWN_YET = (Reason.TOO_FEW_EVENTS, Reason.OUTSIDE_LEARNED_RANGE, Reason.PRELIMINARY)
_PASSING = frozenset({Reason.STARTING, Reason.JUMPED, *_NOT_KNOWN_YET})
"""Reasons that pass by themselves. A second sender does not, so it is more severe."""
_OF_FIT = frozenset(
    {
        Reason.MODEL_INADEQUATE,
        Reason.NOT_LEARNED,
        Reason.SUDDEN_CHANGE,
        Reason.AMBIGUOUS_SCALE,
        Reason.CONTRADICTED,
        Reason.LIFT_SENSOR_LAG,
        Reason.COIL_CURRENT,
    }
)
"""Reasons that are sure only once the event was fitted: until then it may be wear that nobody has learned yet."""
OF_MODEL = _OF_FIT | {Reason.PRESSURE_OFFSET, Reason.SENSOR_LAG, Reason.TIME_BASE}
"""Reasons that say that the measurement contradicts the model, or what was learned."""
_OF_LIVE_RATE = frozenset(
    {
        Reason.NONE,
        Reason.NOT_JUDGED,
        Reason.CONTRADICTED,
        Reason.SUDDEN_CHANGE,
        Reason.PRESSURE_OFFSET,
        Reason.LIFT_SENSOR_LAG,
        Reason.LEARNING_LATE,
        *_NOT_KNOWN_YET,
    }
)
"""Reasons against a rate while it flows that the injection's own pressures overrule: it was not what was believed.

A model or a time base that is wrong is not among them: an event that looks right by chance does not clear them."""


def until_learned(reason: Reason) -> Reason:
    """The reason against an event whose learning is late: nobody can say yet that it contradicts the model."""
    return Reason.LEARNING_LATE if reason in _OF_FIT else reason


def reason_of_injection(
    of_samples: Reason, of_event: Reason, of_inputs: Reason, was_outlier: bool, is_learned: bool = False
) -> Reason:
    """Why an injection is not valid: its samples, unless the judgement of its event overrules them.

    was_outlier: those that contradicted the model were outliers; is_learned: its mass is by its own pressures.
    """
    reason = of_samples
    if is_learned and reason in _OF_LIVE_RATE:
        reason = of_event
    elif reason in (Reason.NONE, Reason.CONTRADICTED):
        reason = Reason.NONE if was_outlier else of_event or reason
    if of_inputs and reason in (Reason.NONE, Reason.NOT_JUDGED, *_NOT_KNOWN_YET):
        reason = of_inputs
    return reason


@dataclass(frozen=True)
class ServiceCondition:
    """Condition of links and inputs as the service knows it."""

    has_frames: bool = True  # any came since the start
    is_cut_off: bool = False  # no input comes, or its interface is down
    is_unprotected: bool = False  # the end-to-end protection of one of the inputs is INVALID
    is_stale: bool = False  # one of the inputs is missing while others arrive


def state_of_service(newest: tuple[State, Reason] | None, condition: ServiceCondition) -> tuple[State, Reason]:
    """State and reason of the service; newest: those of the samples, None before the first."""
    if not condition.has_frames:
        return State.WAITING_FOR_DATA, Reason.STARTING
    if condition.is_cut_off:
        return State.WAITING_FOR_DATA, Reason.INPUT_TIMEOUT
    if condition.is_unprotected:
        return State.DEGRADED, Reason.INPUT_PROTECTION
    if condition.is_stale:
        return State.DEGRADED, Reason.INPUT_STALE
    return newest or (State.STARTING, Reason.STARTING)


def contested(state: State, reason: Reason) -> tuple[State, tuple[Reason, ...]]:
    """State and reasons, the most severe first, where a second sender adds to the other reasons."""
    state = state if state is State.WAITING_FOR_DATA else State.DEGRADED
    if reason is Reason.NONE:
        return state, (Reason.SECOND_SENDER,)
    if reason in _PASSING:
        return state, (Reason.SECOND_SENDER, reason)
    return state, (reason, Reason.SECOND_SENDER)
