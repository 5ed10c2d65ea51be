"""Caveats of an answer: the reservations under which a discovery holds, and what would remove each."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from observer_rt.engine.learning.adequacy import looks_like_inertance
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.identification.discovery.search.results import Discovery, Verdict
from observer_rt.identification.discovery.search.search import indistinguishable
from observer_rt.identification.likelihood.excerpts import distinct
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.fuel import USUAL_PRESSURE
from observer_rt.model.terms.term import Term
from observer_rt.model.terms.variable import Variable

LEAST_MASS = 0.01 * MILLIGRAM  # kg, change of an injected mass below which no caveat is worth a line
COUNTED_VARIABLES = {Variable.INJECTION_NUMBER, Variable.TIME}  # of laws: counted from the start of a recording
MORE_POINTS = "record at least three rail pressures and two durations"


@dataclass(frozen=True)
class Caveat:
    """A reservation. id: for programs; words: for a headline; sentence: what it means, and what would mend it."""

    id: str
    words: str
    sentence: str


class Basis(NamedTuple):
    """Circumstances of a discovery on which its caveats depend."""

    healthy_warning: str  # what healthy recordings say against the model; empty: nothing
    held_out: bool  # whether operating points were left out of the fit, and judged by it
    rate_measured: bool  # whether the recordings have a measured injection rate
    level_measured: bool  # whether the fit of the model had a measured rate or mass
    like_inertance: bool  # whether another inertance of the line would make the same change


def remedies(discovery: Discovery) -> tuple[str, ...]:
    """Remedies for the effects found that no injector file can have in force."""
    return tuple(remedy for effect in discovery.effects if (remedy := VOCABULARY[effect.id].remedy))


def is_level_measured(nominal: EffectiveModel) -> bool:
    """Whether a rate or mass fixed the level of all flows when the model was fitted."""
    baseline = nominal.injector.baseline
    return baseline is not None and baseline.level != "file"


def is_like_inertance(nominal: EffectiveModel, amended: EffectiveModel) -> bool:
    """Whether nozzle flow and stiffness of the line were changed as if the line's inertance were another."""
    before, after = nominal.injector, amended.injector
    stiffness = [one.fluid.in_line.stiffness(USUAL_PRESSURE) / one.line.volume for one in (before, after)]
    nozzle = after.nozzle.flow_coefficient / before.nozzle.flow_coefficient
    return looks_like_inertance(nozzle - 1.0, stiffness[1] / stiffness[0] - 1.0)


def counter_restarts(terms: Sequence[Term]) -> tuple[str, ...]:
    """A sentence for each variable of the laws that is counted from the start: it starts anew every time."""
    counted = {variable: None for term in terms for variable in sorted(term.law.variables & COUNTED_VARIABLES)}
    return tuple(f"{one.word} starts anew with every recording and every start of the daemon" for one in counted)


def caveats_of(discovery: Discovery, basis: Basis) -> tuple[Caveat, ...]:
    """The caveats of a discovery, the gravest first."""
    return (
        *_of_model_and_bench(discovery, basis),
        *_of_operating_points(discovery, basis),
        *_of_explanation(discovery),
        *_of_level(discovery, basis),
    )


def _of_model_and_bench(discovery: Discovery, basis: Basis) -> Iterator[Caveat]:
    """The model may be wrong by itself, or the bench file may be."""
    if basis.healthy_warning:
        yield Caveat("healthy_recordings", "what is named may be the model's own error", basis.healthy_warning)
    for remedy in remedies(discovery):
        text = f"What was found is of the bench, not of the injector: {remedy}, and give the command again with it."
        yield Caveat("bench_file", remedy, f"{text} Until then there is no amended model.")


def _of_operating_points(discovery: Discovery, basis: Basis) -> Iterator[Caveat]:
    """One operating point, or one rail pressure, hides what others would show."""
    if not basis.held_out:
        yield Caveat(
            "one_operating_point",
            "one operating point, nothing held out",
            "All this rests on one operating point: nothing could be held out, and what shows at another rail "
            f"pressure or duration only cannot be told; {MORE_POINTS}.",
        )
    elif distinct({cell.rail_pressure for cell in discovery.before}) == 1:
        yield Caveat(
            "one_rail_pressure",
            "one rail pressure",
            "All this rests on one rail pressure: a factor and an offset of a sensor, or a stiffness and its rise "
            f"with pressure, look alike there; {MORE_POINTS}.",
        )


def _of_explanation(discovery: Discovery) -> Iterator[Caveat]:
    """Another effect would show the same signals, or a law holds for these recordings alone."""
    for effect in discovery.effects:
        same = set(indistinguishable(VOCABULARY[effect.id])).intersection(effect.indistinguishable_from)
        others = " or ".join(sorted(same))
        if others:
            text = f"{effect.id} and {others} have the same effect on every signal; either name is right."
            yield Caveat("same_signals", f"{others} would look the same", text)
    for words in counter_restarts(discovery.shown.terms):
        yield Caveat(
            "starts_anew",
            words,
            f"The law goes by what is counted from the start: {words}. It describes these recordings; later ones, "
            "and an injector that stays as it is now, need a law without it.",
        )


def _of_level(discovery: Discovery, basis: Basis) -> Iterator[Caveat]:
    """Without a measured rate, now or when the model was fitted, the inertance of the line sets the level of flow."""
    nobody_believes = discovery.verdict is Verdict.UNKNOWN and not discovery.proposals
    if basis.rate_measured or nobody_believes:
        return
    if basis.like_inertance:
        settled = " (right when the model was fitted: another fuel since then, say)"
        yield Caveat(
            "line_inertance",
            "another line inertance would look the same",
            "Flow and stiffness of the line changed together as they would for another inertance of the line "
            f"(density, length and diameter in the model){settled if basis.level_measured else ''}; the "
            "injection rate measured tells them apart.",
        )
    elif not basis.level_measured and (
        not discovery.effects or any(abs(effect.moves.mass) >= LEAST_MASS for effect in discovery.effects)
    ):
        yield Caveat(
            "mass_not_measured",
            "injected mass not measured",
            "No injection rate was measured: masses follow from the line pressure and the inertance of the line "
            "(density, length and diameter in the model), and are wrong by the same share where that is. A model "
            "fitted with a measured rate or mass (`observer-rt fit`) has it right.",
        )
