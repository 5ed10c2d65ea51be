"""Validity decided, here only: what is known of a sample, an injection or the service becomes state and reason.

What is valid has no reason. docs/validity.md says who knows what, and when.
"""

from dataclasses import dataclass
from typing import NamedTuple

from observer_rt.foundation.compiled import inner
from observer_rt.foundation.continuity import Doubt
from observer_rt.observer.stream.state import Reason, State

_NONE = int(Reason.NONE)
_STARTING, _JUMPED = int(Reason.STARTING), int(Reason.JUMPED)
_TOO_FEW_EVENTS, _OUTSIDE = int(Reason.TOO_FEW_EVENTS), int(Reason.OUTSIDE_LEARNED_RANGE)
_LIFT_ZERO, _LIFT_DEAD = int(Reason.LIFT_ZERO), int(Reason.LIFT_DEAD)
_CONTRADICTED = int(Reason.CONTRADICTED)
_NO_DOUBT = int(Doubt.NONE)
_STATE_STARTING, _STATE_NOMINAL = int(State.STARTING), int(State.RUNNING_NOMINAL)
_STATE_ADAPTED, _STATE_DEGRADED = int(State.ADAPTED), int(State.DEGRADED)

_NOT_KNOWN_YET = (Reason.TOO_FEW_EVENTS, Reason.OUTSIDE_LEARNED_RANGE)
_PASSING = frozenset({Reason.STARTING, Reason.JUMPED, Reason.REVISED, *_NOT_KNOWN_YET})
"""What is over by itself, which a second sender is not."""


class SampleFacts(NamedTuple):
    """What the stream knows at a sample; reasons are 0 where there is none."""

    unsynchronised_by: int  # Reason since which x~ has not settled
    is_synchronised: bool
    doubt: int  # Doubt of the sample itself
    doubted: int  # Reason a channel is doubted for
    is_lift_beyond: bool  # the zero of the lift has gone too far
    is_lift_dead: bool  # it does not show what the line pressure does
    events: int  # judged, and of samples to be trusted
    events_required: int
    is_familiar: bool  # the flow is known well enough for such an injection
    judgement: int  # Reason the last judged event did not pass
    is_contradicted: bool  # by the innovations since, or by how the needle opened
    has_learned: bool  # something is in force


@inner
def reason_of_sample(facts: SampleFacts) -> int:
    """Why the sample is not valid (Reason), the first that holds; 0: it is."""
    if not facts.is_synchronised:
        return facts.unsynchronised_by
    if facts.doubt != _NO_DOUBT:
        return facts.doubt
    if facts.doubted != _NONE:
        return facts.doubted
    if facts.is_lift_beyond:
        return _LIFT_ZERO
    if facts.is_lift_dead:
        return _LIFT_DEAD
    if facts.events < facts.events_required:
        return _TOO_FEW_EVENTS
    if facts.judgement != _NONE:
        return facts.judgement
    if facts.is_contradicted:
        return _CONTRADICTED
    if not facts.is_familiar:
        return _OUTSIDE
    return facts.unsynchronised_by


@inner
def state_of_sample(facts: SampleFacts, reason: int) -> int:
    """The State at the sample, which has a reason: degraded by what is wrong, not by what is only not known yet."""
    if facts.unsynchronised_by == _STARTING:
        return _STATE_STARTING
    is_unsynchronised = facts.unsynchronised_by != _NONE and facts.unsynchronised_by != _JUMPED
    is_doubted = facts.doubt != _NO_DOUBT or facts.doubted != _NONE or facts.judgement != _NONE
    if is_unsynchronised or is_doubted or reason in (_CONTRADICTED, _LIFT_ZERO, _LIFT_DEAD):
        return _STATE_DEGRADED
    return _STATE_ADAPTED if facts.has_learned else _STATE_NOMINAL


@dataclass(frozen=True)
class InjectionFacts:
    """What is known of an injection once its event was judged.

    of_samples: the first reason of its samples; of_event: that the event did not pass; of_inputs: that the event's
    samples are not to be trusted; was_outlier: what contradicted it was taken for outliers; is_revised: what was
    learned changes its mass.
    """

    of_samples: Reason
    of_event: Reason
    of_inputs: Reason
    was_outlier: bool
    is_revised: bool


def reason_of_injection(facts: InjectionFacts) -> Reason:
    """Why the injection is not valid: the judgement may know better than its samples could."""
    reason = facts.of_samples
    if reason in (Reason.NONE, Reason.CONTRADICTED):
        reason = Reason.NONE if facts.was_outlier else facts.of_event or reason
    if facts.of_inputs and reason in (Reason.NOT_JUDGED, *_NOT_KNOWN_YET):
        reason = facts.of_inputs
    if reason is Reason.NONE and facts.is_revised:
        return Reason.REVISED
    return reason


@dataclass(frozen=True)
class Surroundings:
    """What the service knows of links and inputs."""

    has_frames: bool = True  # any came since the start
    is_cut_off: bool = False  # no input comes, or its interface is down
    is_unprotected: bool = False  # the end-to-end protection of one of the inputs is INVALID
    is_stale: bool = False  # one of the inputs stays away while others come


def state_of_service(newest: tuple[State, Reason] | None, surroundings: Surroundings) -> tuple[State, Reason]:
    """State and reason of the service; newest: those of the samples, None before the first."""
    if not surroundings.has_frames:
        return State.WAITING_FOR_DATA, Reason.STARTING
    if surroundings.is_cut_off:
        return State.WAITING_FOR_DATA, Reason.INPUT_TIMEOUT
    if surroundings.is_unprotected:
        return State.DEGRADED, Reason.INPUT_PROTECTION
    if surroundings.is_stale:
        return State.DEGRADED, Reason.INPUT_STALE
    return newest or (State.STARTING, Reason.STARTING)


def contested(state: State, reason: Reason) -> tuple[State, tuple[Reason, ...]]:
    """State and reasons, the most severe first, where a second sender adds to what is the matter by itself."""
    state = state if state is State.WAITING_FOR_DATA else State.DEGRADED
    if reason is Reason.NONE:
        return state, (Reason.SECOND_SENDER,)
    if reason in _PASSING:
        return state, (Reason.SECOND_SENDER, reason)
    return state, (reason, Reason.SECOND_SENDER)
