"""A proposal: laws that would explain recordings, how much they explain, and objections to them in a model."""

from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

from pydantic import PlainSerializer, computed_field

from observer_rt.engine.estimation.phases import PHASE_NAMES, Phase
from observer_rt.foundation.documents import DocumentPart, Entry, Figure, Figures, Inside, Number, key, unit
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.identification.discovery.law_words import as_if
from observer_rt.identification.discovery.search.candidates import Candidate, Size, size_words
from observer_rt.identification.likelihood.open_loop import Consequence
from observer_rt.model.term_effect import TermLaw
from observer_rt.model.terms.in_force import SeenRange
from observer_rt.model.terms.term import Term

MOST_ENTERING = 2  # terms and effects that a model may be given: more explain anything
_MORE_POINTS = "record more rail pressures and durations"
PhaseName = Annotated[Phase, PlainSerializer(PHASE_NAMES.__getitem__, str)]


class Refusal(NamedTuple):
    """Objection to a proposal in any model, and its remedy, in words."""

    reason: str
    remedy: str


INCOMPLETE = Refusal("it leaves something unexplained", _MORE_POINTS)
TOO_MANY = Refusal("so many laws together would fit anything", f"{_MORE_POINTS}, or the injection rate as well")
AT_BOUND = Refusal("a coefficient would be beyond the bound of its equation", _MORE_POINTS)
TOO_FREE = Refusal("laws with numbers of their own in several equations would fit anything", TOO_MANY.remedy)


@dataclass(frozen=True)
class Part:
    """What a proposal that leaves something explains, and what it leaves.

    closed: share of the line pressure's gap held out, beyond noise; left: rest, rms [Pa]; mass_half: half width of
    the 95 % interval that this gives a mass, as a share; refusal: objection to taking it over in part.
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


class ProposedTerm(DocumentPart):
    """A law added to an equation; sentence: behind `as if`; coefficient: value, ends of its 95 % interval, unit."""

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

    number: from 1, the best; candidate: the terms as effects with one size; gain: of -2 log L over the model as
    given; phase: in which that fails most; adequate: only noise is left; unsound: why a law fails where it was seen;
    held_out: rms of the line pressure's gap on other events, before and after [Pa], nan without any; probability: 0
    of one that leaves something; seen: ranges of inputs; part: None with another objection; largest_lift [m].
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
        effects = (f"{one.id} ({', '.join(size_words(one.parameters, '95 %: '))})" for one in self.stated_effects)
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
                coefficient={"value": term.coefficient, "low": low, "high": high, "unit": str(term.equation.unit)},
                hardly_told_from=term.equation.alike,
                depends_on=tuple(sorted(variable.word for variable in term.law.variables)),
            )
            for term in self.terms
            for low, high in (term.interval or (None, None),)
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
    def refusal(self) -> Refusal | None:
        """Objection to the proposal in any model; None if few terms explain everything, or enough."""
        if self.adequate or self.objection is not None:
            return self.objection
        return INCOMPLETE if self.part is None else self.part.refusal

    @property
    def objection(self) -> Refusal | None:
        """Objection to the terms, however much they explain: many, or with free numbers, they would fit anything."""
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
