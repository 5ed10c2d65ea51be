"""Results of a search: the explanations left, fitted effects, cells of the map, proposals, the verdict. SI."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations
from typing import Annotated

from pydantic import PlainSerializer

from observer_rt.engine.estimation.phases import Phase
from observer_rt.engine.estimation.predictor import NoiseLevels
from observer_rt.foundation.documents import Figure, Inside, key
from observer_rt.identification.discovery.search.candidates import Candidate, Size
from observer_rt.identification.discovery.search.proposal import PhaseName, Proposal
from observer_rt.identification.likelihood.excerpts import point_name
from observer_rt.identification.likelihood.open_loop import Consequence
from observer_rt.identification.likelihood.signals import Signal
from observer_rt.model.effect import WITH_A_MEASURED_RATE, Component, Effect, Equation, Likeness
from observer_rt.model.effects import VOCABULARY

INTERVAL_MARGIN = 1.08  # of standard deviations by a steady gain: errors on independent plants are that much larger
TEMPER = 2.0  # divides -2 log L, for no model knows noise and line exactly: 12 behind are odds of 1 to 20
HIGHEST_PROBABILITY = 0.96  # probability of all candidates together: of 43 that stood alone 3 were wrong
SURE_PROBABILITY = 0.95  # probability from which on a name is an answer, and that the explanations left together hold
_PRESSURE_SENSORS = frozenset({Component.RAIL_SENSOR, Component.LINE_SENSOR})
_BESIDE_SHUT_NEEDLE = {Component.SEAT, Component.LIFT_SENSOR, Component.CLOSED_END}
"""Places at which fuel may leave, or seem to, while the needle is shut."""


class Verdict(StrEnum):
    """The answer in one word."""

    NAMED = "named"
    NONE = "none"
    AMBIGUOUS = "ambiguous"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class FittedEffect:
    """An effect found, with its sizes by parameter.

    gain: rise of -2 log L without it, the others refitted; moves: by adding it last; gap_share: of the disagreement.
    """

    id: str
    parameters: dict[str, Size]
    confidence: float
    indistinguishable_from: tuple[str, ...]
    gap_share: Figure
    moves: Consequence
    gain: Inside[float]


@dataclass(frozen=True)
class Decisive:
    """A measurement that would tell effects apart."""

    measurement: str
    separates: tuple[str, ...]


CellKey = tuple[Signal, Phase, int]


@dataclass(frozen=True)
class Cell:
    """Innovations of one signal in one phase at one operating point (recording)."""

    signal: Signal
    phase: Phase
    recording: int
    rail_pressure: float  # Pa
    duration: float  # s, needle open
    samples: int
    variance: float  # mean square of the normalised innovations; 1: adequate
    colour: float  # mean square of their scaled block means; 1: adequate
    excess: float  # how improbable the larger is for white noise, in standard deviations
    rms: float  # of the innovations (SI)

    @property
    def key(self) -> CellKey:
        """Place in the map: signal, phase, number of the recording."""
        return self.signal, self.phase, self.recording

    @property
    def point(self) -> str:
        return point_name(self.rail_pressure, self.duration)


@dataclass(frozen=True)
class SmallestVisible:
    """The size from which on an effect would have been seen in these recordings, by its first parameter."""

    id: str
    parameter: str
    size: Annotated[float, key("value"), PlainSerializer(lambda size: float(f"{size:.4g}"))]
    unit: str


@dataclass(frozen=True)
class LargestMisfit:
    """The equation and variables that explain most of the misfit, and where; `proposals`: laws, the best first."""

    equation: Equation
    phase: PhaseName
    signal: Signal
    depends_on: tuple[str, ...]
    term: str
    proposals: tuple[Proposal, ...] = ()


@dataclass(frozen=True, eq=False)
class SearchOutcome:
    nominal: Candidate
    winner: Candidate  # the best without a law; the nominal model if no name is accepted
    posterior: tuple[tuple[Candidate, float], ...]  # candidates that explain the recordings, the most probable first
    nearest: tuple[Candidate, ...]  # if none does: the best, and those of other equations that explain as much
    fitted: tuple[Candidate, ...]  # all candidates
    threshold: float  # gain that an effect had to exceed
    ratio: float  # winner's worst phase over its limit; above 1: the winner does not explain the recordings

    @property
    def adequate(self) -> bool:
        return self.ratio <= 1.0

    @property
    def soft(self) -> bool:
        """Whether two effects of the winner are so alike that they may be one."""
        pairs = combinations(self.winner.hypothesis.effects, 2)
        return any(first.is_like(second, Likeness.ALIKE) for first, second in pairs)

    @property
    def left(self) -> tuple[Candidate, ...]:
        """The fewest explanations whose probabilities sum up to SURE_PROBABILITY, the most probable first."""
        candidates, sum_of = list[Candidate](), 0.0
        for candidate, probability in self.posterior:
            if sum_of >= SURE_PROBABILITY * HIGHEST_PROBABILITY:
                break
            candidates.append(candidate)
            sum_of += probability
        return tuple(candidates)

    def probability(self, candidate: Candidate) -> float:
        """Probability of an explanation; 0 for other candidates."""
        return next((odds for other, odds in self.posterior if other.key == candidate.key), 0.0)


def probabilities(behind: Sequence[float]) -> list[float]:
    """Probabilities of explanations that are behind the best by these amounts of -2 log L, prices included."""
    weights = [math.exp(min(0.0, -distance / (2.0 * TEMPER))) for distance in behind]
    return [HIGHEST_PROBABILITY * weight / sum(weights) for weight in weights]


@dataclass(frozen=True)
class Detection:
    """Gain of the winner over the nominal model in -2 log L, and threshold it had to exceed."""

    gain: Figure
    threshold: Figure


@dataclass(frozen=True, kw_only=True)
class Discovery:
    """Result of a search for the missing effect."""

    verdict: Verdict
    confidence: float  # that the verdict is right
    confidence_method: str
    named: Inside[Candidate]  # the winner, or leading when ambiguous; without effects for `none` and `unknown`
    best: Candidate  # as `named`, but for `unknown` what explains most, which is not enough
    effects: tuple[FittedEffect, ...]  # of `named`
    rivals: tuple[tuple[str, ...], ...]  # combinations that explain the recordings as well
    ranking: tuple[Candidate, ...]  # leaders, best first, with the nominal model
    detection: Detection
    unexplained: Annotated[LargestMisfit | None, key("unknown")]
    decide_by: tuple[Decisive, ...]
    samples: Inside[float]  # independent innovations all this rests on
    before: Inside[tuple[Cell, ...]]  # of the nominal model
    after: Inside[tuple[Cell, ...]]  # of the best
    noise: Inside[NoiseLevels]
    smallest_visible: tuple[SmallestVisible, ...] = ()  # of every effect that has a size
    accepted: Annotated[int, key("accepted_proposal")] = 0  # the amended model has; 0: none

    @property
    def noise_ratio(self) -> float:
        """How many times the noise the model as given leaves in its worst cell."""
        return math.sqrt(max(cell.variance for cell in self.before))

    @property
    def proposals(self) -> tuple[Proposal, ...]:
        """Laws that would explain the recordings, the best first."""
        return () if self.unexplained is None else self.unexplained.proposals

    @property
    def proposal(self) -> Proposal | None:
        """The proposal accepted, else the first; None without any."""
        return self.proposals[max(self.accepted, 1) - 1] if self.proposals else None

    @property
    def shown(self) -> Candidate:
        """The proposal accepted, else effects named, else a proposal, else no effects; with half widths of sizes."""
        if self.effects and not self.accepted:
            return next(one for one in self.ranking if one.ids == self.named.ids)
        return self.named if self.proposal is None else self.proposal.candidate


def decide_by(ids: Iterable[str], rate_measured: bool = False) -> tuple[Decisive, ...]:
    """The measurement that would tell any two effects apart. rate_measured: one of the rate already does not."""
    pairs = combinations((VOCABULARY[name] for name in dict.fromkeys(ids)), 2)
    return _by_measurement((_measurement(*pair, rate_measured), (pair[0].id, pair[1].id)) for pair in pairs)


def decide_between(proposals: Sequence[Proposal], rate_measured: bool = False) -> tuple[Decisive, ...]:
    """Measurements that would tell the first proposal from every other one; rate_measured: as of `decide_by`."""
    decisions = []
    for number, other in enumerate(proposals[1:], start=2):
        ours, theirs = (first.candidate.hypothesis.effects for first in (proposals[0], other))
        first = next((effect for effect in ours if effect not in theirs), ours[0])
        instead = next((effect for effect in theirs if effect not in ours), theirs[0])
        decisions.append((_measurement(first, instead, rate_measured), ("proposal 1", f"proposal {number}")))
    return _by_measurement(decisions)


def _by_measurement(decisions: Iterable[tuple[str, tuple[str, str]]]) -> tuple[Decisive, ...]:
    separated: dict[str, dict[str, None]] = {}
    for measurement, names in decisions:
        separated.setdefault(measurement, {}).update(dict.fromkeys(names))
    return tuple(Decisive(measurement, tuple(names)) for measurement, names in separated.items())


def _measurement(first: Effect, second: Effect, rate_measured: bool) -> str:
    relation, places = first.relation_to(second), {first.component, second.component}
    stated = relation.decided_by if relation is not None else first.decided_by or second.decided_by
    if stated:
        return WITH_A_MEASURED_RATE.get(stated, stated) if rate_measured else stated
    if places <= _BESIDE_SHUT_NEEDLE and len(places) > 1 and not rate_measured:
        return "the injection rate or mass measured, or a recording with the needle shut for a second"
    if places & _PRESSURE_SENSORS:
        return "the pressure sensors against a reference gauge, and recordings at more rail pressures"
    at_chamber = Component.CHAMBER in places or Component.NOZZLE in places
    more = "rail pressures and at another chamber pressure" if at_chamber else "rail pressures and durations"
    with_rate = "" if rate_measured else ", with the injection rate measured"
    return f"recordings at more {more}{with_rate}"
