"""Results of a search: the explanations left, fitted effects, cells of the map, proposals, the verdict. SI."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import combinations
from typing import Annotated, NamedTuple

from pydantic import PlainSerializer, computed_field

from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.documents import DocumentPart, Entry, Figure, Figures, Inside, Number, key, unit
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.identification.discovery.law_words import as_if
from observer_rt.identification.discovery.search.candidates import Candidate, Size, size_words
from observer_rt.identification.likelihood.likelihood import Signal
from observer_rt.identification.likelihood.open_loop import Consequence
from observer_rt.identification.likelihood.operating_points import point_name
from observer_rt.model.effect import Equation, Likeness
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.term_effect import TermLaw
from observer_rt.model.terms.in_force import SeenRange
from observer_rt.model.terms.term import Term

MOST_ENTERING = 2  # terms and effects that a model may be given: more explain anything
# For what a steady gain does not know: errors on independent plants are that much larger.
INTERVAL_MARGIN = 1.08
TEMPER = 2.0  # of -2 log L, for what no model knows of noise and line: 12 behind are odds of 1 to 20
HIGHEST = 0.96  # of all candidates, the rest for what none of them is: of 43 that stood alone 3 were wrong
SURE = 0.95  # probability from which on a name is an answer, and that the explanations left together hold
_MORE_POINTS = "record more rail pressures and durations"


PHASE_NAMES = {
    Phase.STANDSTILL: "closed",
    Phase.OPENING: "opening",
    Phase.OPEN: "open",
    Phase.CLOSING: "closing",
    Phase.AFTER: "after",
}
PhaseName = Annotated[Phase, PlainSerializer(PHASE_NAMES.__getitem__, str)]


class Verdict(StrEnum):
    """The answer in one word."""

    NAMED = "named"
    NONE = "none"
    AMBIGUOUS = "ambiguous"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class FittedEffect:
    """An effect found, with its sizes by parameter.

    gain: what -2 log L rises without it, the others refitted; moves: what it does when it comes last; gap_share: of
    the disagreement, that it explains.
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


@dataclass(frozen=True)
class Cell:
    """Innovations of one signal in one phase at one operating point (recording).

    variance, colour: mean square of the normalised innovations and of their scaled block means, 1 when adequate;
    excess: how improbable the larger is for white noise, in standard deviations; rms: of the innovations (SI).
    """

    signal: Signal
    phase: Phase
    recording: int
    rail_pressure: float  # Pa
    duration: float  # s, needle open
    samples: int
    variance: float
    colour: float
    excess: float
    rms: float

    @property
    def point(self) -> str:
        """Names the operating point."""
        return point_name(self.rail_pressure, self.duration)


@dataclass(frozen=True)
class SmallestVisible:
    """The size from which on an effect would have been seen in these recordings, by its first parameter."""

    id: str
    parameter: str
    size: Annotated[float, key("value"), PlainSerializer(lambda size: float(f"{size:.4g}"))]
    unit: str


class Refusal(NamedTuple):
    """Objection to a proposal in any model, and its remedy, in words."""

    reason: str
    remedy: str


INCOMPLETE = Refusal("it leaves something unexplained", _MORE_POINTS)
TOO_MANY = Refusal(
    "so many laws together would fit anything", f"{_MORE_POINTS}, or the injection rate as well"
)
AT_BOUND = Refusal("a coefficient would be beyond the bound of its equation", _MORE_POINTS)
TOO_FREE = Refusal("laws with numbers of their own in several equations would fit anything", TOO_MANY.remedy)


@dataclass(frozen=True)
class Part:
    """What a proposal that leaves something explains, and what it leaves.

    closed: share of the line pressure's gap held out, beyond noise; left: rest of it, rms [Pa]; mass_half: half
    width, as a share, of the 95 % interval that this gives a mass; refusal: objection to taking it over in part.
    """

    closed: float
    left: Annotated[float, key("left_MPa"), unit(MEGAPASCAL)]
    mass_half: Annotated[float, key("mass_ci95_pct"), PlainSerializer(lambda share: 100.0 * share)]
    refusal: Annotated[
        Refusal | None, key("refused"), PlainSerializer(lambda one: "" if one is None else one.reason)
    ] = None


def _gap_held_out(gap: tuple[float, float], _: object) -> Figures:
    before, after = gap
    return {"before_MPa": before / MEGAPASCAL, "after_MPa": after / MEGAPASCAL}


def _stated(term: Term) -> tuple[Number | str, ...]:
    return term.coefficient, *(term.interval or (None, None)), str(term.equation.unit)


class ProposedTerm(DocumentPart):
    """A law added to an equation. sentence: in words, behind `as if`;
    coefficient: value, ends of its 95 % interval, unit."""

    equation: str
    law: str
    sentence: str
    coefficient: dict[str, Number | str]
    hardly_told_from: tuple[str, ...]
    depends_on: tuple[str, ...]


class ProposedEffect(DocumentPart):
    """An effect of the vocabulary beside the terms of a proposal, with its sizes by parameter."""

    id: str
    parameters: dict[str, Size]


@dataclass(frozen=True)
class Proposal:
    """Terms that would explain the recordings, perhaps beside effects of the vocabulary.

    number: from 1, the best; candidate: the terms as effects with one size, and their intervals; gain: of -2 log L
    over the model as given; phase: in which the model as given fails most; adequate: nothing but noise is left;
    unsound: why a law fails where it was seen, None where all hold; held_out: rms of the line pressure's gap on
    events it was not fitted to, before and after [Pa], nan where nothing was held out; probability: among all
    explanations tried, 0 of one that leaves something; seen: between what its inputs lay; part: of one that leaves
    something but has no other objection; largest_lift: of the needle [m], for words.
    """

    candidate: Inside[Candidate]
    gain: Figure
    phase: PhaseName
    adequate: bool
    unsound: Inside[Refusal | None]
    held_out: Annotated[tuple[float, float], key("gap_held_out"), Entry(_gap_held_out, Figures)]
    probability: float = 0.0
    seen: Inside[SeenRange] = field(default_factory=dict)
    part: Annotated[Part | None, key("in_part")] = None
    largest_lift: Inside[float | None] = None
    number: int = 1

    @property
    def terms(self) -> tuple[Term, ...]:
        """Terms, with 95 % intervals of their coefficients."""
        return self.candidate.terms

    @computed_field(alias="seen")  # type: ignore[prop-decorator]
    @property
    def seen_of_terms(self) -> dict[str, tuple[float, float]]:
        """Range of every variable of its laws in which they were seen, by name."""
        variables = {one for term in self.terms for one in term.law.variables}
        return {one.word: self.seen[one] for one in sorted(variables & set(self.seen))}

    @computed_field  # type: ignore[prop-decorator]
    @property
    def sentence(self) -> str:
        """The proposal in words, such as `as if the nozzle lost 15.1 % of its flow`."""
        parts = [as_if(term, self.largest_lift) for term in self.terms]
        effects = (
            f"{one.id} ({', '.join(size_words(one.parameters, '95 %: '))})" for one in self.stated_effects
        )
        return " with ".join([*([f"as if {' and '.join(parts)}"] if parts else []), *effects])

    @computed_field(alias="terms")  # type: ignore[prop-decorator]
    @property
    def stated_terms(self) -> tuple[ProposedTerm, ...]:
        """Its terms for programs."""
        return tuple(
            ProposedTerm(
                equation=term.equation,
                law=str(term.law),
                sentence=as_if(term, self.largest_lift),
                coefficient=dict(zip(("value", "low", "high", "unit"), _stated(term), strict=True)),
                hardly_told_from=term.equation.alike,
                depends_on=tuple(sorted(variable.word for variable in term.law.variables)),
            )
            for term in self.terms
        )

    @computed_field(alias="effects")  # type: ignore[prop-decorator]
    @property
    def stated_effects(self) -> tuple[ProposedEffect, ...]:
        """The effects of the vocabulary beside them."""
        return tuple(ProposedEffect(id=name, parameters=of) for name, of in self.candidate.parameters.items())

    @computed_field  # type: ignore[prop-decorator]
    @property
    def sound(self) -> bool:
        """Whether its laws are bounded where they were seen."""
        return self.unsound is None

    @computed_field  # type: ignore[prop-decorator]
    @property
    def moves(self) -> Consequence:
        """What it does to the model as given."""
        return self.candidate.moves

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of the effects of the vocabulary beside them."""
        return self.candidate.named

    @property
    def refusal(self) -> Refusal | None:
        """Objection to the proposal in any model; None where it explains all, or enough, with few terms."""
        if self.adequate or self.objection is not None:
            return self.objection
        return INCOMPLETE if self.part is None else self.part.refusal

    @property
    def objection(self) -> Refusal | None:
        """Objection to its terms, however much they explain.

        What blames several equations must do it without numbers within its laws: with them it would fit anything.
        """
        effects = self.candidate.hypothesis.effects
        laws = [effect.apply for effect in effects if isinstance(effect.apply, TermLaw)]
        if not self.candidate.within_bounds:
            return AT_BOUND
        if len(effects) > MOST_ENTERING and laws:
            return TOO_MANY
        if len({effect.component for effect in effects}) > 1 and any(law.numbers for law in laws):
            return TOO_FREE
        return self.unsound

    @computed_field  # type: ignore[prop-decorator]
    @property
    def may_enter(self) -> bool:
        """Whether a model may be given it."""
        return self.refusal is None

    def model(self, nominal: EffectiveModel) -> EffectiveModel:
        """The model with it."""
        return self.candidate.model(nominal)


@dataclass(frozen=True)
class LargestMisfit:
    """Phase and signal in which the model as given fails most; equation, variables and text of what explains most.

    proposals: laws that would explain the recordings, the best first.
    """

    equation: Equation
    phase: PhaseName
    signal: Signal
    depends_on: tuple[str, ...]
    term: str
    proposals: tuple[Proposal, ...] = ()


@dataclass(frozen=True, eq=False)
class SearchOutcome:
    """Result of the search.

    winner: the best without a law, the nominal model when no name is accepted; posterior: probabilities of all
    candidates that explain the recordings, the best first; nearest: without any, the best, and those of
    other equations that explain as much; fitted: all candidates; threshold: the gain an effect had to exceed; ratio:
    of the winner's worst phase to its limit, above 1 when the winner does not explain the recordings, not even with
    an effect too small to matter.
    """

    nominal: Candidate
    winner: Candidate
    posterior: tuple[tuple[Candidate, float], ...]
    nearest: tuple[Candidate, ...]
    fitted: tuple[Candidate, ...]
    threshold: float
    ratio: float

    @property
    def adequate(self) -> bool:
        """Whether the winner explains the recordings."""
        return self.ratio <= 1.0

    @property
    def soft(self) -> bool:
        """Whether two effects were named together that are so alike that they may be one."""
        pairs = combinations(self.winner.hypothesis.effects, 2)
        return any(one.is_like(other, Likeness.ALIKE) for one, other in pairs)

    @property
    def left(self) -> tuple[Candidate, ...]:
        """The fewest explanations that together are as good as sure, the most probable first."""
        candidates, sum_of = list[Candidate](), 0.0
        for candidate, probability in self.posterior:
            if sum_of >= SURE * HIGHEST:
                break
            candidates.append(candidate)
            sum_of += probability
        return tuple(candidates)

    def probability(self, candidate: Candidate) -> float:
        """Probability of an explanation; 0 for other candidates."""
        return next((odds for other, odds in self.posterior if other.key == candidate.key), 0.0)


def probabilities(behind: Sequence[float]) -> list[float]:
    """Probabilities of explanations that are behind the best by these amounts of -2 log L, their prices in it."""
    weights = [math.exp(min(0.0, -one / (2.0 * TEMPER))) for one in behind]
    return [HIGHEST * weight / sum(weights) for weight in weights]


@dataclass(frozen=True)
class Detection:
    """Gain of the winner over the nominal model in -2 log L, and threshold it had to exceed."""

    gain: Figure
    threshold: Figure


@dataclass(frozen=True, kw_only=True)
class Discovery:
    """Result of a search for the missing effect.

    named: the winner, or the leading explanation when ambiguous; without effects for `none` and `unknown`; best: the
    same, but for `unknown` what explains most, which is not enough; effects: those of the named; rivals: combinations
    that explain the recordings as well; ranking: leaders, best first, with the nominal model; samples: independent
    innovations all this rests on; before, after: cells of the nominal model and of the best; confidence: that the
    verdict is right; explained: share of the disagreement: of what -2 log L has above that of an adequate model;
    smallest_visible: of every effect that has a size; accepted: number of the proposal that the amended model has, 0
    for none.
    """

    verdict: Verdict
    confidence: float
    confidence_method: str
    named: Inside[Candidate]
    best: Candidate
    effects: tuple[FittedEffect, ...]
    rivals: tuple[tuple[str, ...], ...]
    ranking: tuple[Candidate, ...]
    detection: Detection
    unexplained: Annotated[LargestMisfit | None, key("unknown")]
    decide_by: tuple[Decisive, ...]
    explained: Inside[float]
    samples: Inside[float]
    before: Inside[tuple[Cell, ...]]
    after: Inside[tuple[Cell, ...]]
    noise: Inside[NoiseLevels]
    smallest_visible: tuple[SmallestVisible, ...] = ()
    accepted: Annotated[int, key("accepted_proposal")] = 0

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
        """What was found, with half widths of its sizes: the proposal accepted, the effects named, else a proposal;
        without effects if nothing was found."""
        if self.effects and not self.accepted:
            return next(one for one in self.ranking if one.ids == self.named.ids)
        return self.named if self.proposal is None else self.proposal.candidate
