"""Laws that explain recordings as proposals: with intervals, consequences, gaps held out, and whether a model may
have them."""

from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from observer_rt.config.effects import term_domain
from observer_rt.engine.learning.healthy import Healthy
from observer_rt.foundation.errors import UserError
from observer_rt.identification.discovery.search.adequacy import Adequacy, worst
from observer_rt.identification.discovery.search.fits import Fitter
from observer_rt.identification.discovery.search.held_out import HeldOutPoints
from observer_rt.identification.discovery.search.hypothesis import Hypothesis
from observer_rt.identification.discovery.search.law_evidence import law_curve
from observer_rt.identification.discovery.search.library import span_of
from observer_rt.identification.discovery.search.outcome import SearchOutcome
from observer_rt.identification.discovery.search.results import (
    INTERVAL_MARGIN,
    TOO_FREE,
    TOO_MANY,
    Candidate,
    LawCurve,
    Proposal,
    Refusal,
)
from observer_rt.identification.discovery.search.scores import Scores
from observer_rt.identification.discovery.search.seen import seen_in
from observer_rt.identification.likelihood.bounded_fit import NORMAL_975
from observer_rt.identification.likelihood.open_loop import consequence
from observer_rt.model.effect import Effect
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.term_effect import is_term
from observer_rt.model.terms.bounds import refuse_unbounded
from observer_rt.model.terms.in_force import SeenRange
from observer_rt.model.terms.term import Term


class Proposer:
    """Makes proposals of what a search found."""

    def __init__(
        self, fitter: Fitter, outcome: SearchOutcome, healthy: Healthy, held_out: HeldOutPoints
    ) -> None:
        self._fitter, self._outcome, self._held_out = fitter, outcome, held_out
        self._nominal = fitter.nominal
        self._measured = [recorded.measurement for recorded in fitter.likelihood.recordings]
        self._adequate = Adequacy(fitter, healthy)
        pool = fitter.pool(outcome.nominal)
        assert pool is not None  # the search began with it
        self._phase = worst(pool, healthy).phase
        self._seen = seen_in(self._measured, self._nominal)

    def proposals(self, laws: Sequence[Candidate]) -> tuple[Proposal, ...]:
        """Of these, the first with its laws drawn. Where that piles up laws and leaves something all the same, the
        best of them alone is one more."""
        made = [self._proposal(one) for one in laws]
        made = [replace(one, curves=self._curves(one.candidate)) for one in made[:1]] + made[1:]
        if made and not made[0].adequate and made[0].objection in (TOO_MANY, TOO_FREE):
            first = made[0].candidate
            pairs = zip(first.hypothesis.effects, first.sizes, strict=True)
            alone = [(Hypothesis((effect,)), np.array([size])) for effect, size in pairs if is_term(effect)]
            made += [
                self._proposal(one) for one in sorted(self._fitter.laws(alone), key=attrgetter("price"))[:1]
            ]
        return tuple(made)

    def _proposal(self, candidate: Candidate) -> Proposal:
        model, outcome = candidate.model(self._nominal), self._outcome
        half = NORMAL_975 * INTERVAL_MARGIN * self._fitter.sigmas(candidate)
        moves = consequence(self._measured, self._nominal, model)
        return Proposal(
            replace(
                candidate,
                half=tuple(half.tolist()),
                moves=moves,
                sizes_of_half=self._held_out.sizes(candidate),
            ),
            outcome.nominal.statistic - candidate.statistic,
            self._phase,
            self._adequate(candidate),
            unsound(candidate.terms, self._nominal, self._seen),
            (self._held_out.gap(outcome.nominal), self._held_out.gap(candidate)),
            probability=outcome.probability(candidate),
            seen=self._seen,
            largest_lift=self._nominal.injector.seat.max_lift,
        )

    def _curves(self, candidate: Candidate) -> tuple[LawCurve, ...]:
        """The laws of a proposal over their variables."""
        span = span_of(self._fitter.likelihood)

        def score(effects: Sequence[Effect]) -> Scores:
            return self._fitter.scores(candidate, effects)

        drawn = (
            law_curve(term, score, candidate.spread, (span.time, span.injections)) for term in candidate.terms
        )
        return tuple(curve for curve in drawn if curve is not None)


def unsound(terms: Sequence[Term], nominal: EffectiveModel, seen: SeenRange) -> Refusal | None:
    """Objection to an injector file with these terms more, their inputs held where they were seen; None: none."""
    domain = term_domain(nominal.injector)
    try:
        for term in terms:
            refuse_unbounded(replace(term, law=term.law.held(seen)), domain)
    except UserError as error:
        return Refusal(f"{error.location} {error.problem}", error.remedy)
    return None
