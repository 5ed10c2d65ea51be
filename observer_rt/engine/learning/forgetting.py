"""What learning forgets upon which cause, as one table."""

from collections.abc import Mapping
from enum import Enum, auto


class Cause(Enum):
    """Why what was learned or said so far no longer holds."""

    OTHER_NOISE = auto()  # noise levels are others than those that events were judged by
    STEEP_NOISE = auto()  # samples are taken at moments that are off: what that adds contradicted the model
    COLOUR = auto()  # the noise has a colour: what events contradicted was judged by white noise
    RANGE_ENDS = auto()  # the line pressure's range ends: clipped samples contradicted the model
    COIL = auto()  # what the coil adds is taken out from now on: all was learned from other line pressures
    SUDDEN_CHANGE = auto()  # the injector is another one
    NOT_PASSED = auto()  # an event did not pass: by it nothing is compared
    PASSED = auto()  # a fault has passed, and what was believed and said before it holds
    FROZEN = auto()  # the standstill contradicts the model: what was learned belongs to another line


class Forgotten(Enum):
    """What there is to be forgotten."""

    LEARNED = auto()  # theta and belief: as before any event
    CERTAINTY = auto()  # of the belief: widened by the prior
    OPERATING_POINTS = auto()  # learned at
    STATISTICS = auto()  # of the innovations of recent events
    STATISTICS_OF_INJECTIONS = auto()  # the same but of standstill
    MISTRUST = auto()  # after events that were not explained
    FREEZING = auto()  # that learning is frozen, and what led to it
    SLOWED = auto()  # that the line-pressure sensor became slower all at once
    COLOUR = auto()  # of the noise, and what was heard of it
    TREND = auto()  # what recent events contradicted together
    CHECKPOINT = auto()  # what was believed before events that did not pass
    LAST_EVENT = auto()  # by which a new theta is compared with that in force


FORGOTTEN: Mapping[Cause, frozenset[Forgotten]] = {
    Cause.OTHER_NOISE: frozenset({Forgotten.STATISTICS}),
    Cause.STEEP_NOISE: frozenset({Forgotten.STATISTICS, Forgotten.MISTRUST}),
    Cause.COLOUR: frozenset({Forgotten.TREND}),
    Cause.RANGE_ENDS: frozenset({Forgotten.STATISTICS_OF_INJECTIONS, Forgotten.MISTRUST, Forgotten.COLOUR}),
    Cause.COIL: frozenset(
        {
            Forgotten.CERTAINTY,
            Forgotten.STATISTICS,
            Forgotten.MISTRUST,
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
