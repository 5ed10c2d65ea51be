"""The search for the missing effect: effects by name, alone and in pairs, and laws; its verdict is a posterior."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from operator import attrgetter

import numpy as np

from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy
from observer_rt.identification.discovery.search.fits import NEAR, Fitter, best_of_each
from observer_rt.identification.discovery.search.held_out import HeldOutPoints
from observer_rt.identification.discovery.search.laws import KEPT_SHARE, TIE, Adequacy, Laws, LawSearch
from observer_rt.identification.discovery.search.library import library, span_of
from observer_rt.identification.discovery.search.results import UNNAMED, Candidate
from observer_rt.identification.likelihood.appearance import least_gain
from observer_rt.model.effect import Effect, Likeness
from observer_rt.model.effects import VOCABULARY

RELATIVE_GAIN = 1e-3  # of what is explained, that one more effect must add to an adequate model
LEADERS = 3  # singles that a second effect is added to
LED = 0.5  # of what a law explains, that a leader must where one law explains all
TEMPER = 2.0  # of -2 log L, for what no model knows of noise and line: 12 behind are odds of 1 to 20
HIGHEST = 0.99
SURE = 0.95  # probability from which on a name is an answer, and that the explanations left together hold
PAIR = 2


@dataclass(frozen=True, eq=False)
class SearchOutcome:
    """Result of the search.

    winner: the best named effects, the nominal model when none is accepted; laws: the laws found, None where they
    were not tried; posterior: probabilities of all candidates that explain the recordings, the best first; fitted:
    all candidates; threshold: the gain an effect had to exceed; ratio: of the winner's worst phase to its limit,
    above 1 when the winner does not explain the recordings, not even with an effect too small to matter.
    """

    nominal: Candidate
    winner: Candidate
    laws: Laws | None
    posterior: tuple[tuple[Candidate, float], ...]
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


def representatives() -> tuple[Effect, ...]:
    """The vocabulary with one effect of every class that no recording can tell apart."""
    chosen: list[Effect] = []
    for effect in VOCABULARY.values():
        if not any(effect.is_like(other, Likeness.SAME) for other in chosen):
            chosen.append(effect)
    return tuple(chosen)


def indistinguishable(effect: Effect) -> tuple[str, ...]:
    """Ids of the effects no recording can tell from this one."""
    return tuple(other.id for other in VOCABULARY.values() if effect.is_like(other, Likeness.SAME))


class Search:
    """Names alone, pairs of them where something is left to explain, laws where it takes two names or more."""

    def __init__(self, fitter: Fitter, effects: Sequence[Effect], baseline: Healthy = NOT_FITTED) -> None:
        self._fitter = fitter
        self._effects = effects
        self._baseline = baseline
        self._least_gain = least_gain(baseline.appears)
        self._adequate = Adequacy(fitter, baseline)
        self.held_out = HeldOutPoints(fitter.likelihood, fitter.nominal)

    @cached_property
    def _library(self) -> tuple[Effect, ...]:
        """Laws without a name, as effects."""
        return tuple(library(span_of(self._fitter.likelihood)))

    def run(self) -> SearchOutcome:
        """Fit candidates until nothing more is worth adding; see `SearchOutcome`."""
        nominal = self._fitter.nothing()
        singles = sorted(self._fitter.singles(self._effects, nominal), key=attrgetter("price"))
        best, ratio = nominal, self._ratio(nominal)
        single = self._best(singles, nominal, best, ratio)
        if single is not None:
            best, ratio = single, self._ratio(single)
        by_law = self._law_search.enough if ratio > 1.0 else None
        pairs = self._pairs(singles, best, ratio, by_law)
        pair = self._best(pairs, nominal, best, ratio, singles)
        if pair is not None:
            best, ratio = pair, self._ratio(pair)
        too_small = ratio > 1.0 and best is nominal and self._is_too_small(singles[0])
        adequate = ratio <= 1.0 or too_small
        laws = self._laws(pairs) if self._asks_laws(best, adequate) else None
        fitted = (nominal, *singles, *pairs, *(() if laws is None else laws.tried))
        if laws is not None and not adequate and laws.adequate and not laws.best.terms:
            three = self._best([laws.best], nominal, best, ratio, pairs)
            if three is not None:
                best, ratio, adequate = three, self._ratio(three), True
        explains = list[Candidate]()
        if adequate:
            explains = [best, *self._contenders(best, fitted), nominal]
        if laws is not None and laws.adequate:
            best_laws = (laws.best, *laws.rivals)
            explains += [one for one in best_laws if one.terms]
        return SearchOutcome(
            nominal,
            best,
            laws,
            self._posterior(best, explains),
            fitted,
            self._threshold(best),
            min(ratio, 1.0) if adequate else ratio,
        )

    def _asks_laws(self, best: Candidate, adequate: bool) -> bool:
        """Whether laws are asked: where no name explains the recordings, or it takes two, or one leaves a law."""
        if not adequate or len(best.ids) >= PAIR:
            return True
        if not best.ids:
            return False
        scores = self._fitter.scores(best, self._library)
        return bool(np.max(scores.validated, initial=0.0) > UNNAMED * best.spread)

    @cached_property
    def _law_search(self) -> LawSearch:
        """Laws beside effects of one size."""
        named = (effect for effect in self._effects if len(effect.parameters) == 1)
        return LawSearch(self._fitter, [*self._library, *named], self._adequate)

    def _laws(self, pairs: Sequence[Candidate]) -> Laws:
        """Laws; a third is sought beside the best pair, too."""
        near = sorted((one for one in pairs if len(one.sizes) == PAIR), key=attrgetter("price"))[:1]
        return self._law_search.run(near)

    def _posterior(
        self, best: Candidate, explains: Sequence[Candidate]
    ) -> tuple[tuple[Candidate, float], ...]:
        """Probabilities of explanations, the best by name among them; beside nothing others pay their threshold."""
        accepted = 0.0 if best.ids else self._threshold(best)

        def cost(candidate: Candidate) -> float:
            return candidate.price + (accepted if candidate.ids else 0.0)

        once = {
            frozenset(candidate.ids): candidate for candidate in reversed(explains)
        }  # the first fit of each
        ranked = sorted(once.values(), key=cost)
        behind = [cost(candidate) - cost(ranked[0]) for candidate in ranked]
        return tuple(zip(ranked, probabilities(behind), strict=True))

    def _contenders(self, winner: Candidate, fitted: Sequence[Candidate]) -> tuple[Candidate, ...]:
        """Candidates that might be right instead, of the same size (single effects beside the nominal model)."""
        size = max(1, len(winner.ids))
        limit = winner.price + NEAR + (0.0 if winner.ids else self._threshold(winner))
        return tuple(
            one
            for one in fitted
            if one is not winner
            and len(one.ids) == size
            and one.plausible
            and one.price < limit
            and self._is_new(one)
        )

    def _is_too_small(self, single: Candidate) -> bool:
        """Whether a single explains the recordings by an effect within its dead zone."""
        return single.within_bounds and not single.plausible and self._ratio(single) <= 1.0

    def _pairs(
        self, singles: Sequence[Candidate], best: Candidate, ratio: float, law: Candidate | None
    ) -> list[Candidate]:
        """Pairs worth fitting: with the best single, with more leaders when it does not explain the recordings.

        Where a pair is worth having, its other member leads, too: the best single may stand in for two. law: one that
        explains all; a leader must explain a good part of that, and a pair as much.
        """
        if not best.hypothesis.effects and ratio <= 1.0:
            return []
        leaders, goal = list(singles[: 1 if ratio <= 1.0 else LEADERS]), math.inf
        if law is not None:
            nominal, goal = self._fitter.nothing().statistic, law.price + NEAR
            least = LED * (nominal - law.statistic)
            leaders = [one for one in leaders if nominal - one.statistic > least]
        if not leaders:
            return []
        pairs = best_of_each(self._fitter.pairs(leaders, self._effects, goal), attrgetter("price"))
        partners = [
            one for one in singles if pairs and set(one.ids) < set(pairs[0].ids) and one not in leaders
        ]
        if partners and pairs[0].statistic < leaders[0].statistic - self._least_gain:
            more = self._fitter.pairs(partners, self._effects, goal)
            pairs = best_of_each([*pairs, *more], attrgetter("price"))
        return pairs

    def _best(
        self,
        candidates: Sequence[Candidate],
        nominal: Candidate,
        smaller: Candidate,
        ratio: float,
        parts: Sequence[Candidate] = (),
    ) -> Candidate | None:
        """The best candidate whose every effect is plausible and pays for itself; None: no better one.

        parts: fitted singles; a pair must beat each of its own.
        """
        limit = np.inf
        for candidate in candidates:
            threshold = self._threshold(candidate)
            if ratio <= 1.0:
                threshold = max(threshold, RELATIVE_GAIN * (nominal.statistic - smaller.statistic))
            own = [part for part in parts if set(part.ids) < set(candidate.ids)]
            if own and self._baseline.appears:  # what is less may be the error of the fitted model
                threshold = max(threshold, KEPT_SHARE * (nominal.statistic - candidate.statistic))
            gain = min(part.statistic for part in (smaller, *own)) - candidate.statistic
            if gain <= threshold or candidate.statistic > limit:
                continue
            if candidate.plausible:
                if self._is_new(candidate) and self.held_out.pays(
                    candidate, min((smaller, *own), key=attrgetter("statistic"))
                ):
                    return candidate
                continue
            if len(candidate.hypothesis.effects) == 1 and candidate.within_bounds:
                # too small to matter, and yet it explains better than what would follow
                limit = min(limit, candidate.statistic + TIE)
        return None

    def _is_new(self, candidate: Candidate) -> bool:
        """Whether every size differs from what the effect appears to be on the healthy injector."""
        if not self._baseline.appears:
            return True
        sigmas, position = self._fitter.sigmas(candidate), 0
        for effect, values in zip(
            candidate.hypothesis.effects, candidate.hypothesis.split(candidate.theta), strict=True
        ):
            mean, sigma = self._fitter.reference(effect)
            if values.size and abs(values[0] - mean) < math.sqrt(self._least_gain) * math.hypot(
                float(sigmas[position]), sigma
            ):
                return False
            position += values.size
        return True

    def _threshold(self, candidate: Candidate) -> float:
        """Least gain of an effect beside a candidate: more, the more that leaves unexplained."""
        return self._least_gain * candidate.spread

    def _ratio(self, candidate: Candidate) -> float:
        return self._adequate.ratio(candidate)


def probabilities(behind: Sequence[float]) -> list[float]:
    """Probabilities of explanations that are behind the best by these amounts of -2 log L, their prices in it."""
    weights = [math.exp(min(0.0, -one / (2.0 * TEMPER))) for one in behind]
    return [HIGHEST * weight / sum(weights) for weight in weights]
