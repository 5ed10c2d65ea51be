"""Table of what learning forgets upon which cause."""

from collections.abc import Mapping
from dataclasses import replace
from enum import Enum, auto
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.learning.adequacy import of_standstill
from observer_rt.engine.learning.state import LearningState


class Cause(Enum):
    """Cause for which what was learned or objected so far no longer holds."""

    OTHER_NOISE = auto()  # noise levels are others than those that events were judged by
    STEEP_NOISE = auto()  # samples are taken at moments that are off: what that adds contradicted the model
    COLOUR = auto()  # the noise has a colour: what events contradicted was judged by white noise
    RANGE_ENDS = auto()  # the line pressure's range ends: clipped samples contradicted the model
    COIL = auto()  # what the coil adds is taken out from now on: all was learned from other line pressures
    SUDDEN_CHANGE = auto()  # the injector is another one
    NOT_PASSED = auto()  # an event did not pass: by it nothing is compared
    PASSED = auto()  # a fault has passed, and what was believed and objected before it holds
    FROZEN = auto()  # the standstill contradicts the model: what was learned belongs to another line


class Forgotten(Enum):
    """Part of the state to be forgotten; by the name of a field of the state, which is then as before any event."""

    LEARNED = "belief, theta"  # as before any event
    CERTAINTY = "certainty"  # of the belief: widened by the prior
    OPERATING_POINTS = "learned_at"
    STATISTICS = "statistics"  # of the innovations of recent events
    STATISTICS_OF_INJECTIONS = "statistics but of standstill"
    MISTRUST = "mistrust"  # after events that were not explained
    RELAPSES = "relapses"  # how often events contradicted the model anew
    FREEZING = "freezer"  # that learning is frozen, and what led to it
    SLOWED = "slowed"  # that the line-pressure sensor became slower all at once
    COLOUR = "at_rest"  # of the noise, and the statistics of it
    TREND = "trend"  # what recent events contradicted together
    CHECKPOINT = "checkpoint"  # what was believed before events that did not pass
    LAST_EVENT = "last_event"  # by which a new theta is compared with that in force


FORGOTTEN: Mapping[Cause, frozenset[Forgotten]] = {
    Cause.OTHER_NOISE: frozenset({Forgotten.STATISTICS, Forgotten.RELAPSES}),
    Cause.STEEP_NOISE: frozenset({Forgotten.STATISTICS, Forgotten.MISTRUST, Forgotten.RELAPSES}),
    Cause.COLOUR: frozenset({Forgotten.TREND}),
    Cause.RANGE_ENDS: frozenset(
        {Forgotten.STATISTICS_OF_INJECTIONS, Forgotten.MISTRUST, Forgotten.RELAPSES, Forgotten.COLOUR}
    ),
    Cause.COIL: frozenset(
        {
            Forgotten.CERTAINTY,
            Forgotten.STATISTICS,
            Forgotten.MISTRUST,
            Forgotten.RELAPSES,
            Forgotten.COLOUR,
            Forgotten.TREND,
            Forgotten.CHECKPOINT,
            Forgotten.LAST_EVENT,
        }
    ),
    Cause.SUDDEN_CHANGE: frozenset({Forgotten.LAST_EVENT}),
    Cause.NOT_PASSED: frozenset({Forgotten.LAST_EVENT}),
    Cause.PASSED: frozenset(
        {
            Forgotten.MISTRUST,
            Forgotten.FREEZING,
            Forgotten.SLOWED,
            Forgotten.TREND,
            Forgotten.LAST_EVENT,
        }
    ),
    Cause.FROZEN: frozenset({Forgotten.LEARNED, Forgotten.OPERATING_POINTS, Forgotten.LAST_EVENT}),
}


def forgotten(
    state: LearningState, cause: Cause, start: LearningState, wide: NDArray[np.float64]
) -> LearningState:
    """State without what no longer holds.

    start: before any event; wide: standard deviations (m,) of theta then.
    """
    parts, learned, fresh = FORGOTTEN[cause], state.learned, start.learned
    changes: dict[str, Any] = {}
    if Forgotten.LEARNED in parts:
        changes |= {name: getattr(fresh, name) for name in ("belief", "theta", "active", "is_prior")}
    if Forgotten.CERTAINTY in parts:
        changes["belief"] = learned.belief.widened(wide)
    if Forgotten.STATISTICS in parts:
        changes["statistics"] = fresh.statistics
    if Forgotten.STATISTICS_OF_INJECTIONS in parts:
        changes["statistics"] = of_standstill(learned.statistics)
    if Forgotten.COLOUR in parts:
        changes["colour"] = None
    fields = {part.value: getattr(start, part.value) for part in parts if hasattr(start, part.value)}
    return replace(state, learned=replace(learned, **changes), **fields)
