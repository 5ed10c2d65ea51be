"""The search for the missing effect: forward from the model as it is, with removal; its verdict is a posterior.

Candidates are effects of the vocabulary, laws, or both. One linearised pass scores what may be added to them.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy
from observer_rt.identification.discovery.search.adequacy import Adequacy, HeldOutPoints
from observer_rt.identification.discovery.search.candidates import LAW_ODDS, Candidate, Hypothesis
from observer_rt.identification.discovery.search.fits import MOST_NAMED, NEAR_GAIN, Fitter
from observer_rt.identification.discovery.search.laws import MOST_EFFECTS, Guess, Laws
from observer_rt.identification.discovery.search.results import SearchOutcome, probabilities
from observer_rt.identification.likelihood.appearance import least_gain
from observer_rt.model.effect import Component, Effect, Likeness
from observer_rt.model.effects import VOCABULARY, seen_in
from observer_rt.model.effects.needle import BESIDE

MOST_BASES = 3  # candidates to which effects are added at once
REFITTED_NAMES = 6  # refitted beside a candidate, of the best by score
WORTH_FITTING = 10.0  # gain by score from which on a further name is refitted
PROMISED_SHARE = 0.5  # of a gain that is needed: a score is linear, and not exact
LAW_CHARGE = 0.5  # of what a name leaves, that a law must take to stand in its place beside a fitted model
BASE_SHARE = 0.5  # of what the best explains, that a candidate must explain for effects to be added to it
TIED_GAIN = 16.0  # of -2 log L, within which fits explain as much
RELATIVE_GAIN, FITTED_GAIN = 1e-3, 0.02  # Of what is explained, that an effect must add; beside a fitted model.
LEAST_SHARE, KEPT_SHARE = 0.05, 0.02  # Of what is left unexplained, that a further law must gain; that it keeps.


def representatives(has_lift: bool, stiffens: bool = False) -> tuple[Effect, ...]:
    """The vocabulary with one effect of every class that no recording can tell apart.

    has_lift: as of `seen_in`; stiffens: the fuel, with its pressure, which separates its stiffness from the volume.
    """
    chosen: list[Effect] = []
    for effect in seen_in(has_lift):
        if stiffens or not any(effect.is_like(other, Likeness.SAME) for other in chosen):
            chosen.append(effect)
    return tuple(chosen)


def indistinguishable(effect: Effect, stiffens: bool = False) -> tuple[str, ...]:
    """Ids of the effects no recording can tell from this one; stiffens: as of `representatives`."""
    return tuple(other.id for other in VOCABULARY.values() if not stiffens and effect.is_like(other, Likeness.SAME))


class Search:
    """Goes on from the best few, an effect or two of one equation at a time, as long as that pays."""

    def __init__(
        self, fitter: Fitter, names: Sequence[Effect], baseline: Healthy = NOT_FITTED, guess: Guess = None
    ) -> None:
        self._fitter, self._names, self._baseline = fitter, tuple(names), baseline
        self._least_gain = least_gain(baseline.appears)
        self._is_adequate = Adequacy(fitter, baseline)
        self._laws = Laws(fitter, self._names, self._is_adequate, guess)
        self._nothing = fitter.nothing()
        self._tried = [self._nothing]
        self._twins: list[Candidate] = []
        self.held_out = HeldOutPoints(fitter.likelihood, fitter.nominal)

    def run(self) -> SearchOutcome:
        """Search for what explains the recordings: one name, then several effects or laws, then one law instead."""
        names = self._fitter.fits_beside(self._nothing, self._names)
        self._tried += names
        best = self._better(names, self._nothing) or self._nothing
        adequate = self._is_adequate(best) or (
            # an effect within its dead zone may explain the recordings
            not best.ids and any(one.is_too_small and self._is_adequate.ratio(one) <= 1.0 for one in names[:1])
        )
        if best.ids or not adequate:
            best = self._grown(best)
            adequate = self._is_adequate(best)
        if len(best.ids) > 1 and adequate and not best.terms:
            self._tried += self._laws.made_alone  # A law may do what several names do.
            best = min(best, self._better(self._laws.made_alone, self._nothing) or best, key=self._rank)
        if len(best.ids) == 1 and (best.terms or adequate):
            self._tried += self._laws.stand_ins(best)
            self._charge_laws()
            better = self._better([one for one in self._tried if len(one.ids) == 1], self._nothing)
            if better is None and not best.terms and self._is_adequate(self._nothing):
                better = self._nothing  # laws explain it better than the name, and are too small to matter
            best = better or best
        if best.ids and adequate and not best.terms:
            self._twins = list(self._other_needles(best))
        return self._outcome(best, adequate)

    def _other_needles(self, best: Candidate) -> Iterator[Candidate]:
        """Candidates as good with, or without, a faulty needle whose lift was not recorded.

        The best gains nothing over them: true strokes are not as straight as those of the model.
        """
        for effect in best.hypothesis.effects:
            others = tuple(kept for kept in best.hypothesis.effects if kept is not effect)
            for other in self._names:
                places = {effect.component, other.component}
                if Component.NEEDLE not in places or other in others or not effect.is_like(other, Likeness.ALIKE):
                    continue
                partners = [VOCABULARY[name] for name in BESIDE.get(other.id, ()) if name not in best.ids]
                hypotheses = [Hypothesis((*others, other)), Hypothesis((*others, other, *partners))]
                for candidate in self._fitter.laws([(each, each.off) for each in hypotheses]):
                    if self._is_adequate(candidate) and candidate.within_bounds:
                        yield replace(candidate, own_error=min(0.0, best.price - candidate.price))
                        break

    def _charge_laws(self) -> None:
        """Beside a fitted model laws pay half of what the best name leaves: it may be the model's own error."""
        names = [one for one in self._tried if len(one.ids) == 1 and not one.terms and one.plausible]
        left = [self._unexplained(one) for one in names if self._is_adequate(one)]
        if self._baseline.appears and left:
            charge = LAW_CHARGE * min(left)
            self._tried = [replace(one, own_error=charge) if one.terms else one for one in self._tried]

    def _grown(self, best: Candidate) -> Candidate:
        if not self._is_adequate(best) or self._laws.promise(best) > LAW_ODDS * best.spread:
            laws = self._laws.fits_with(self._nothing)
            best = min(best, self._better(laws, self._nothing) or best, key=self._rank)
            self._tried += laws
        about, done = self._first_bases(best), set[tuple[str, ...]]()
        while about:
            grown = list[Candidate]()
            for base in about:
                done.add(base.ids)
                for fits in self._larger_fits(base, best):
                    self._tried += fits
                    best = min(best, self._better(fits, base) or best, key=self._rank)
                    grown += self._next_bases(fits, base)
            left = [one for one in grown if one.ids not in done and len(one.ids) < MOST_EFFECTS]
            ranked = sorted({one.ids: one for one in left}.values(), key=self._rank)
            about = ranked[:MOST_BASES]
            if all(one.terms for one in about):  # laws are free to stand for several names
                about += [one for one in ranked if not one.terms][:1]
        return best

    def _next_bases(self, fits: Sequence[Candidate], about: Candidate) -> list[Candidate]:
        """The best fit if it gains something, and its effects as fitted alone."""
        best = self._without_idle(self._simplest(fits)) if fits else about
        if best.statistic >= about.statistic - self._threshold(about):
            return []
        return [best, *(one for one in self._tried if len(one.ids) == 1 and set(one.ids) < set(best.ids))]

    def _rank(self, candidate: Candidate) -> tuple[bool, float]:
        return not self._is_adequate(candidate), candidate.price

    def _first_bases(self, best: Candidate) -> list[Candidate]:
        """The best, and where no name explains all, fits in other equations that explain a good part."""
        firsts = [best] if best.ids else []
        if self._is_adequate(best) and not best.terms:
            return firsts
        least = self._nothing.statistic - BASE_SHARE * (self._nothing.statistic - best.statistic)
        for fit in sorted(self._tried, key=attrgetter("price")):
            if len(firsts) == MOST_BASES or (best.ids and fit.statistic > least):
                break
            if fit.ids and not any(fit.hypothesis.equations & other.hypothesis.equations for other in firsts):
                firsts.append(self._without_idle(fit))
        return firsts

    def _larger_fits(self, about: Candidate, best: Candidate) -> Iterator[list[Candidate]]:
        """Fits with an effect or two more that may reach the best: names and, where no name explains all, laws."""
        arrears = PROMISED_SHARE * (about.price - best.price - NEAR_GAIN)
        names = [one for one in self._names if one not in about.hypothesis.effects]
        scores, least = self._fitter.scores(about, names), max(WORTH_FITTING, arrears)
        rows = [row for row in np.argsort(-scores.gains).tolist() if scores.gains[row] > least][:REFITTED_NAMES]
        sizes = [float(scores.sizes((row,))[0]) for row in rows]
        fits = self._fitter.fits_beside(about, [scores.effects[row] for row in rows], sizes)
        yield fits
        if any(map(self._is_adequate, fits[:1])) or (self._is_adequate(best) and best is not about):
            return
        price = LAW_ODDS * about.spread if self._is_adequate(about) else -math.inf
        if self._laws.promise(about) > max(arrears, price):
            yield self._laws.fits_with(about)

    def _better(self, fits: Sequence[Candidate], smaller: Candidate) -> Candidate | None:
        """The simplest of the best fits that pays for what it has more; None where none does."""
        limit = math.inf
        ranked = sorted(fits, key=attrgetter("price"))
        if ranked and ranked[0].terms:
            ranked.insert(0, self._simplest(ranked))
        for candidate in ranked:
            if candidate.price >= smaller.price or candidate.statistic > limit:
                break
            candidate = self._without_idle(candidate)
            if self._pays(candidate, smaller):
                return candidate
            if len(candidate.ids) == 1 and candidate.is_too_small:
                # too small to matter, and yet it explains better than what would follow
                limit = min(limit, candidate.statistic + TIED_GAIN)
        return None

    def _pays(self, candidate: Candidate, smaller: Candidate) -> bool:
        parts = [one for one in self._tried if set(one.ids) < set(candidate.ids)]
        over = min((smaller, *parts), key=attrgetter("statistic"))
        return (
            candidate.plausible
            and candidate.price < over.price
            and over.statistic - candidate.statistic > self._needed(candidate, over, LEAST_SHARE)
            and self._is_new(candidate)
            and self.held_out.pays(candidate, over)
        )

    def _needed(self, candidate: Candidate, over: Candidate, share: float) -> float:
        """Gain over a smaller one that a candidate must exceed: a share may be the model's own error."""
        explained = self._nothing.statistic - candidate.statistic
        least = self._threshold(over)
        if candidate.terms:
            return max(least, self._own_error(candidate), share * self._unexplained(over))
        if not over.ids:
            return least
        return max(least, (FITTED_GAIN if self._baseline.appears else RELATIVE_GAIN) * explained)

    def _unexplained(self, candidate: Candidate) -> float:
        """Residuals beyond noise, as `statistic` counts them."""
        samples = sum(int(one.phases.size + one.rate_phases.size) for one in self._fitter.likelihood.recordings)
        return (candidate.spread - 1.0) * samples

    def _own_error(self, candidate: Candidate) -> float:
        return self._is_adequate.remainder * (self._nothing.statistic - candidate.statistic)

    def _is_new(self, candidate: Candidate) -> bool:
        """Whether every size differs from what the effect appears to be on the healthy injector."""
        if not self._baseline.appears:
            return True
        sigmas = candidate.hypothesis.split(self._fitter.sigmas(candidate))
        for (effect, values, _), own in zip(candidate.parts, sigmas, strict=True):
            mean, sigma = self._fitter.reference(effect)
            distance, doubt = np.abs(values[:1] - mean), np.hypot(own[:1], sigma)  # (0,) of a switch
            if np.any(distance < math.sqrt(self._least_gain) * doubt):
                return False
        return True

    def _threshold(self, candidate: Candidate) -> float:
        """Least gain of an effect beside a candidate: more, the more that leaves unexplained."""
        return self._least_gain * candidate.spread

    def _simplest(self, fits: Sequence[Candidate]) -> Candidate:
        """The best fit, or one that explains as much by fewer effects, equations or numbers, adequate ones first."""
        best = min(fits, key=attrgetter("price"))
        limit = best.price + max(self._own_error(best), TIED_GAIN * best.spread)

        def burden(candidate: Candidate) -> tuple[int, int, bool, float]:
            of = candidate.hypothesis
            return len(candidate.ids), len(of.equations), max(of.numbers) > MOST_NAMED, candidate.price

        tied = sorted((one for one in fits if one.price <= limit), key=burden)
        return next(filter(self._is_adequate, tied), tied[0])

    def _without_idle(self, best: Candidate) -> Candidate:
        for effect in best.hypothesis.effects:
            if len(best.ids) < 2:
                break
            for smaller in self._fitter.laws([best.without(effect)]):
                if smaller.statistic - best.statistic < self._needed(best, smaller, KEPT_SHARE):
                    best = smaller
        return best

    def _outcome(self, best: Candidate, adequate: bool) -> SearchOutcome:
        posterior = self._posterior(best) if adequate else ()
        winner = best if adequate and not best.terms else self._nothing
        if best.terms:
            winner = next((one for one, _ in posterior if not one.terms), self._nothing)
        ratio = self._is_adequate.ratio(winner)
        rivals = [one for one in self._alternatives(best) if one.statistic < best.statistic + TIED_GAIN * best.spread]
        left, tried = () if adequate else (best, *rivals), tuple(self._tried)
        ratio = min(ratio, 1.0) if winner is best and adequate else ratio
        return SearchOutcome(self._nothing, winner, posterior, left, tried, self._threshold(best), ratio)

    def _alternatives(self, best: Candidate) -> list[Candidate]:
        """Explanations of no more effects that might be right instead, one by laws of each equation."""
        accepted = 0.0 if best.ids else self._threshold(best)
        limit = best.price + NEAR_GAIN + accepted
        small = (one.statistic for one in self._tried if len(one.ids) == 1 and one.is_too_small)
        # single effects must come up to one that is too small to matter, where it explains better
        most = math.inf if best.ids else min(small, default=math.inf) + TIED_GAIN
        once: dict[frozenset[str], Candidate] = {_class_of(best): best}
        for fit in sorted(self._tried, key=attrgetter("price")):
            explains = fit.price < limit and fit.statistic < most
            explains = explains and 0 < len(fit.ids) <= max(1, len(best.ids)) and fit.plausible
            if explains and _class_of(fit) not in once and self._is_new(fit):
                once[_class_of(fit)] = fit
        return list(once.values())[1:]

    def _posterior(self, best: Candidate) -> tuple[tuple[Candidate, float], ...]:
        """Probabilities of explanations; beside nothing others pay their threshold."""
        accepted = 0.0 if best.ids else self._threshold(best)

        def cost(candidate: Candidate) -> float:
            return candidate.price + (accepted if candidate.ids else 0.0)

        every = {one.key: one for one in (best, *self._twins, *self._alternatives(best), self._nothing)}
        ranked = sorted(every.values(), key=cost)
        behind = [cost(candidate) - cost(ranked[0]) for candidate in ranked]
        return tuple(zip(ranked, probabilities(behind), strict=True))


def _class_of(candidate: Candidate) -> frozenset[str]:
    """Names, or the equations of its laws: candidates equal in this are one explanation."""
    return candidate.hypothesis.equations if candidate.terms else frozenset(candidate.ids)
