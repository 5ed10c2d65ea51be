"""The search for the missing effect: singles, pairs, and the verdict."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from observer_rt.discovery.search.adequacy import NO_BASELINE, HealthyBaseline, worst
from observer_rt.discovery.search.candidates import NEAR, Fitter, best_of_each
from observer_rt.discovery.search.held_out import HeldOutPoints
from observer_rt.discovery.search.result import Candidate
from observer_rt.evidence.appearance import least_gain
from observer_rt.evidence.pooled import pool_of
from observer_rt.model.effect import Effect, Likeness
from observer_rt.model.effects import VOCABULARY

RELATIVE_GAIN = 1e-3  # of what is explained, that one more effect must add to an adequate model
TIE = 16.0  # of -2 log L within which a rival explains the recordings as well
LEADERS = 3  # singles that a second effect is added to
PARAMETER_PRICE = 10.0  # of -2 log L for each parameter more, log(n): which of two near-ties leads


@dataclass(frozen=True, eq=False)
class SearchOutcome:
    """How the search ended. winner: the nominal model when nothing is accepted; rivals: as many effects, as good.

    ratio: of the winner's worst phase to its limit, above 1 when the winner does not explain the recordings;
    contenders: candidates of the winner's size that might be right instead; fitted: all candidates; threshold: the
    gain an effect had to exceed; too_small: an effect within its dead zone explains what is left.
    """

    nominal: Candidate
    winner: Candidate
    rivals: tuple[Candidate, ...]
    contenders: tuple[Candidate, ...]
    fitted: tuple[Candidate, ...]
    threshold: float
    ratio: float
    too_small: bool

    @property
    def adequate(self) -> bool:
        """Whether the winner explains the recordings, or would with an effect too small to matter."""
        return self.ratio <= 1.0 or self.too_small

    def led_by(self, ids: Collection[str]) -> "SearchOutcome":
        """The same with another of those that explain the recordings as well as the winner.

        Raises ValueError when these effects together are none of them.
        """
        for rival in self.rivals:
            if set(rival.ids) == set(ids):
                others = (self.winner, *(one for one in self.rivals if one is not rival))
                return replace(self, winner=rival, rivals=others)
        if set(self.winner.ids) != set(ids):
            raise ValueError(f"{' + '.join(ids)} is not among those that explain the recordings")
        return self

    @property
    def soft(self) -> bool:
        """Whether two effects were named together that are so alike that they may be one."""
        pairs = combinations(self.winner.hypothesis.effects, 2)
        return any(one.is_like(other, Likeness.ALIKE) for one, other in pairs)


def representatives(vocabulary: Mapping[str, Effect] = VOCABULARY) -> tuple[Effect, ...]:
    """The vocabulary with one effect of every class that no recording can tell apart."""
    chosen: list[Effect] = []
    for effect in vocabulary.values():
        if not any(effect.is_like(other, Likeness.SAME) for other in chosen):
            chosen.append(effect)
    return tuple(chosen)


def indistinguishable(effect: Effect) -> tuple[str, ...]:
    """Ids of the effects no recording can tell from this one."""
    return tuple(other.id for other in VOCABULARY.values() if effect.is_like(other, Likeness.SAME))


class Search:
    """Singles, then pairs where something is left to explain."""

    def __init__(
        self, fitter: Fitter, effects: Sequence[Effect], baseline: HealthyBaseline = NO_BASELINE
    ) -> None:
        self._fitter = fitter
        self._effects = effects
        self._baseline = baseline
        self._least_gain = least_gain(baseline.appears)
        self.held_out = HeldOutPoints(fitter.evidence, fitter.nominal)

    def run(self) -> SearchOutcome:
        """Fit candidates until nothing more is worth adding; see `SearchOutcome`."""
        nominal = self._fitter.nothing()
        singles = sorted(self._fitter.singles(self._effects, nominal), key=price)
        best, threshold, ratio = nominal, self._threshold(nominal), self._ratio(nominal)
        single = self._best(singles, nominal, best, ratio)
        if single is not None:
            best, ratio = single, self._ratio(single)
            threshold = self._threshold(best)
        pairs = self._pairs(singles, best, ratio)
        pair = self._best(pairs, nominal, best, ratio, singles)
        if pair is not None:
            best, ratio = pair, self._ratio(pair)
            threshold = self._threshold(best)
        fitted = (nominal, *singles, *pairs)
        too_small = ratio > 1.0 and best is nominal and self._is_too_small(singles[0])
        contenders = self._contenders(best, fitted, threshold)
        return SearchOutcome(
            nominal, best, self._rivals(best, fitted), contenders, fitted, threshold, ratio, too_small
        )

    def _contenders(
        self, winner: Candidate, fitted: Sequence[Candidate], threshold: float
    ) -> tuple[Candidate, ...]:
        """What else might be right, of the same size (single effects beside the nominal model)."""
        size = max(1, len(winner.hypothesis.effects))
        limit = price(winner) + NEAR + (0.0 if winner.hypothesis.effects else threshold)
        return tuple(
            one
            for one in fitted
            if one is not winner
            and len(one.hypothesis.effects) == size
            and one.plausible
            and price(one) < limit
            and self._is_new(one)
        )

    def _is_too_small(self, single: Candidate) -> bool:
        """Whether a single explains the recordings by an effect within its dead zone."""
        return single.within_bounds and not single.plausible and self._ratio(single) <= 1.0

    def _pairs(self, singles: Sequence[Candidate], best: Candidate, ratio: float) -> list[Candidate]:
        """Pairs worth fitting: with the best single, with more leaders when it does not explain the recordings.

        Where a pair is worth having, its other member leads, too: the best single may stand in for two.
        """
        if not best.hypothesis.effects and ratio <= 1.0:
            return []
        leaders = list(singles[: 1 if ratio <= 1.0 else LEADERS])
        pairs = best_of_each(self._fitter.pairs(leaders, self._effects), price)
        partners = [
            one for one in singles if pairs and set(one.ids) < set(pairs[0].ids) and one not in leaders
        ]
        if partners and pairs[0].statistic < leaders[0].statistic - self._least_gain:
            pairs = best_of_each([*pairs, *self._fitter.pairs(partners, self._effects)], price)
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

        parts: fitted singles, of which a pair must beat each of its own.
        """
        limit = np.inf
        for candidate in candidates:
            threshold = self._threshold(candidate)
            if ratio <= 1.0:
                threshold = max(threshold, RELATIVE_GAIN * (nominal.statistic - smaller.statistic))
            own = [part for part in parts if set(part.ids) < set(candidate.ids)]
            gain = min(part.statistic for part in (smaller, *own)) - candidate.statistic
            if gain <= threshold or candidate.statistic > limit:
                continue
            if candidate.plausible:
                if self._is_new(candidate) and self.held_out.pays(
                    candidate, min((smaller, *own), key=_statistic)
                ):
                    return candidate
                continue
            if len(candidate.hypothesis.effects) == 1 and candidate.within_bounds:
                # too small to matter, and yet it explains better than what would follow
                limit = min(limit, candidate.statistic + TIE)
        return None

    def _rivals(self, winner: Candidate, fitted: Sequence[Candidate]) -> tuple[Candidate, ...]:
        size = len(winner.hypothesis.effects)
        return tuple(
            other
            for other in fitted
            if other is not winner
            and len(other.hypothesis.effects) == size
            and other.statistic < winner.statistic + TIE
            and other.plausible
            and self._is_new(other)
        )

    def _is_new(self, candidate: Candidate) -> bool:
        """Whether every size differs from what the effect appears to be on the healthy injector."""
        if not self._baseline.appears:
            return True
        sigmas, place = self._fitter.sigmas(candidate), 0
        for effect, values in zip(
            candidate.hypothesis.effects, candidate.hypothesis.split(candidate.theta), strict=True
        ):
            healthy = self._fitter.reference(effect)
            if values.size and abs(values[0] - healthy.mean) < math.sqrt(self._least_gain) * math.hypot(
                float(sigmas[place]), healthy.sigma
            ):
                return False
            place += values.size
        return True

    def _threshold(self, candidate: Candidate) -> float:
        """What an effect must gain beside what a candidate leaves unexplained: more the more that is."""
        residuals = self._fitter.evidence.residuals(candidate.model(self._fitter.nominal))
        if residuals is None:
            return np.inf
        return self._least_gain * max(1.0, float(np.mean(residuals.z**2)))

    def _ratio(self, candidate: Candidate) -> float:
        """Of a candidate's worst phase to its limit."""
        judged = self._fitter.evidence.judge(candidate.model(self._fitter.nominal))
        if judged is None:
            return np.inf
        return worst(pool_of(self._fitter.evidence, judged), self._baseline).ratio


def _statistic(candidate: Candidate) -> float:
    return candidate.statistic


def price(candidate: Candidate) -> float:
    """-2 log L with a price for every parameter."""
    return candidate.statistic + PARAMETER_PRICE * len(candidate.sizes)
