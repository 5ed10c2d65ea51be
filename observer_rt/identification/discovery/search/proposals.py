"""Proposes terms where no effect of the vocabulary explains recordings, or a term does it clearly better."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.effects import term_domain
from observer_rt.engine.learning.healthy import Healthy
from observer_rt.foundation.errors import UserError
from observer_rt.identification.discovery.search.adequacy import worst
from observer_rt.identification.discovery.search.candidates import Fitter
from observer_rt.identification.discovery.search.law_evidence import law_curve
from observer_rt.identification.discovery.search.results import (
    Candidate,
    Consequence,
    LawCurve,
    Proposal,
    Refusal,
)
from observer_rt.identification.discovery.search.search import (
    HeldOutPoints,
    SearchOutcome,
    price,
)
from observer_rt.identification.discovery.search.term_fit import PRICE, TermFit, no_terms
from observer_rt.identification.discovery.search.term_library import InjectorTerms, RecordingSpan, library
from observer_rt.identification.discovery.search.term_scores import scores_of
from observer_rt.identification.discovery.search.term_search import TIE, TermSearch, TermSearchResult
from observer_rt.identification.likelihood.likelihood import JointLikelihood, pool_of
from observer_rt.model.effect import Effect
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.term_effect import is_term
from observer_rt.model.terms.bounds import refuse_unbounded

CLEARLY = 50.0  # of -2 log L, by which a term must beat the vocabulary to be offered in its place
SEVERAL = 2  # effects together, of which one law may take the place
MOST_PROPOSED, MOST_LOST = 4, 8
PAIR = 2

Moves = Callable[[EffectiveModel, EffectiveModel], Consequence]


def propose(
    fitter: Fitter, outcome: SearchOutcome, baseline: Healthy, held_out: HeldOutPoints, moves: Moves
) -> tuple[Proposal, ...]:
    """The best first, then what explains as much by another equation; none where the vocabulary does.

    Without an effect that explains the recordings, all that terms explain is proposed; else only what does it
    clearly better.
    """
    named = len(outcome.winner.hypothesis.effects) if outcome.adequate else SEVERAL
    if named == 0 or (named < SEVERAL and not _leaves_a_term(fitter, outcome, baseline)):
        return ()
    problem = InjectorTerms(
        fitter.likelihood, fitter.nominal, _candidates(fitter.likelihood, outcome), baseline
    )
    result = TermSearch(problem, fitter.each).run(_near(problem, outcome))
    if not result.best.chosen or (outcome.adequate and not _beats(problem, result.best, outcome)):
        return ()
    judged = fitter.likelihood.judge(fitter.nominal)
    assert judged is not None  # the search began with it
    phase = worst(pool_of(fitter.likelihood, judged), baseline).phase
    before = held_out.gap(outcome.nominal)

    def proposal(fit: TermFit) -> Proposal:
        found = Candidate.fitted(problem.hypothesis(fit.chosen), fit.theta, fit.statistic, fit.sigmas)
        model = found.model(fitter.nominal)
        return Proposal(
            replace(found, moves=moves(fitter.nominal, model)),
            result.nothing.statistic - fit.statistic,
            phase,
            problem.is_adequate(fit.chosen, fit.theta),
            unsound(model, fitter.nominal),
            (before, held_out.gap(found)),
        )

    first, *others = (proposal(fit) for fit in (result.best, *result.rivals)[:MOST_PROPOSED])
    curves = _curves(fitter, first, result.best, baseline)
    return (replace(first, curves=curves, lost=_lost(problem, result)), *others)


def _lost(problem: InjectorTerms, result: TermSearchResult) -> tuple[Candidate, ...]:
    """Laws that were fitted and are not proposed, the best of each combination of equations first."""
    proposed = {one.chosen for one in (result.best, *result.rivals)}
    best: dict[tuple[str, ...], Candidate] = {}
    for fit in result.tried:
        hypothesis = problem.hypothesis(fit.chosen)
        key = tuple(sorted(problem.candidates[number].equation for number in fit.chosen))
        if fit.chosen not in proposed and fit.statistic > result.best.statistic + TIE * result.best.spread:
            best.setdefault(key, Candidate(hypothesis, tuple(fit.theta.tolist()), fit.statistic))
    return tuple(best.values())[:MOST_LOST]


def _near(
    problem: InjectorTerms, outcome: SearchOutcome
) -> list[tuple[tuple[int, ...], NDArray[np.float64]]]:
    """The best pair of effects, to which a third may be wanting; none where one of them has several sizes."""
    pairs = (one for one in outcome.fitted if len(one.hypothesis.effects) == len(one.sizes) == PAIR)
    return [
        (tuple(map(problem.number_of, one.hypothesis.effects)), one.theta)
        for one in sorted(pairs, key=price)[:1]
    ]


def _curves(fitter: Fitter, first: Proposal, best: TermFit, baseline: Healthy) -> tuple[LawCurve, ...]:
    """The laws of a proposal over their variables."""
    span, model = _span(fitter.likelihood), first.model(fitter.nominal)

    def about_here(effects: Sequence[Effect]) -> InjectorTerms:
        return InjectorTerms(fitter.likelihood, model, effects, baseline)

    reach = (span.time, span.injections)
    drawn = (law_curve(term, about_here, best.residuals, fitter.each, reach) for term in first.terms)
    return tuple(one for one in drawn if one is not None)


def _leaves_a_term(fitter: Fitter, outcome: SearchOutcome, baseline: Healthy) -> bool:
    """Whether a term alone would gain much beside what the vocabulary found."""
    model = outcome.winner.model(fitter.nominal)
    terms = list(library(_span(fitter.likelihood)))
    problem = InjectorTerms(fitter.likelihood, model, terms, baseline)
    nothing = no_terms(problem)
    gains = scores_of(problem, nothing, fitter.each).validated
    return bool(np.max(gains, initial=0.0) > CLEARLY * nothing.spread)


def _beats(problem: InjectorTerms, best: TermFit, outcome: SearchOutcome) -> bool:
    """Whether terms explain all, and clearly more than the effects named, each counted by its price.

    One term in place of several effects need not do it clearly.
    """
    if not any(is_term(effect) for effect in problem.hypothesis(best.chosen).effects):
        return False
    named = outcome.winner.statistic + PRICE * len(outcome.winner.sizes)
    margin = CLEARLY if len(best.chosen) >= len(outcome.winner.hypothesis.effects) else 0.0
    better = best.statistic + PRICE * len(best.chosen) < named - margin
    return better and problem.is_adequate(best.chosen, best.theta)


def _candidates(likelihood: JointLikelihood, outcome: SearchOutcome) -> list[Effect]:
    """The library, and the effects of the vocabulary that have one size."""
    singles = (one.hypothesis.effects[0] for one in outcome.fitted if len(one.hypothesis.effects) == 1)
    return [*library(_span(likelihood)), *(effect for effect in singles if len(effect.parameters) == 1)]


def _span(likelihood: JointLikelihood) -> RecordingSpan:
    """Range of time and injection number in the recordings."""
    events = list(chain.from_iterable(recorded.measurement.events for recorded in likelihood.recordings))
    last = max(event.clock.injections + len(event.openings) for event in events)
    return RecordingSpan(max(event.clock.time for event in events), last)


def unsound(model: EffectiveModel, nominal: EffectiveModel) -> Refusal | None:
    """Objection to an injector file with the terms that a model has beyond the nominal one; None where it may."""
    domain = term_domain(nominal.injector)
    try:
        for term in model.terms[len(nominal.terms) :]:
            refuse_unbounded(term, domain)
    except UserError as error:
        return Refusal(f"{error.place} {error.problem}", error.remedy)
    return None
