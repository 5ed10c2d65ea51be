"""Searches for terms that a model misses: refits those whose scores are best, and adds what is worth it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from observer_rt.identification.discovery.search.term_fit import Each, TermFit, TermProblem, no_terms
from observer_rt.identification.discovery.search.term_scores import Scores, scored, scores_of
from observer_rt.identification.likelihood.bounded_fit import Minimum, Residuals, fit

SAME = 0.998  # cosine of two signatures of one equation, from which on the weaker one is not fitted
REFITTED, REFITTED_PAIRS = 5, 3  # of the best by score
PAIR_GAIN, PAIR_SHARE = 30.0, 0.05  # that a pair of one equation must gain over the best single to be fitted
TIE = 16.0  # of -2 log L, within which fits explain as much
LEAST_GAIN, LEAST_SHARE = 25.0, 0.05  # of what is left unexplained, that a further term must gain
KEPT_SHARE = 0.02  # of the same, that a term already taken must be worth
MOST_TERMS = 3
SHORTLIST = 40  # candidates of further terms that are linearised again
STARTS = 2  # first terms from which others are sought, where the best ends inadequate
SHARPENED = 2  # best fits, in which the numbers within laws are fitted, too
ITERATIONS = 6  # of a refit


@dataclass(frozen=True, eq=False)
class TermSearchResult:
    """Result of a search for terms.

    best: the terms found, none where nothing is worth one; nothing: the model as it is; adequate: whether the best
    leaves nothing but noise; rivals: of other equations, the best fit of as many terms that explains as much; tried:
    all that was fitted, the best first.
    """

    nothing: TermFit
    best: TermFit
    adequate: bool
    rivals: tuple[TermFit, ...]
    tried: tuple[TermFit, ...] = ()


class TermSearch:
    """Adds terms one after another, or two of one equation at once, until nothing but noise is left."""

    def __init__(self, problem: TermProblem, each: Each) -> None:
        self._problem = problem
        self._each = each
        self._first: Scores | None = None  # of the model as it is
        self._known: dict[tuple[int, ...], TermFit | None] = {}

    def run(self, near: Sequence[tuple[tuple[int, ...], NDArray[np.float64]]] = ()) -> TermSearchResult:
        """See `TermSearchResult`. Raises ArithmeticError where the model itself has no solution.

        near: candidates found together before, with their coefficients, to which one may be wanting.
        """
        nothing = best = no_terms(self._problem)
        tried: list[TermFit] = []
        adequate = self._is_adequate(nothing)
        if not adequate:
            tried = self._next(nothing)
            known = self._fits(lambda i: self._fit(*near[i]), len(near))
            firsts = [*self._firsts(tried, nothing), *known]
            for first in sorted(firsts, key=lambda one: (not self._is_adequate(one), one.price)):
                grown = self._grown(first, nothing, tried)
                if grown in known:  # found wanting as it is: only what comes to it counts
                    continue
                is_adequate = self._is_adequate(grown)
                if (not is_adequate, grown.price) < (not adequate, best.price):
                    best, adequate = grown, is_adequate
                if adequate and (len(best.chosen) < MOST_TERMS or first in known):
                    break
        rivals: dict[frozenset[str], TermFit] = {}
        ranked = tuple(sorted(tried, key=attrgetter("price")))
        for one in ranked:
            if self._is_rival(one, best):
                rivals.setdefault(frozenset(self._equations(one)), one)
        return TermSearchResult(nothing, best, adequate, tuple(rivals.values()), ranked)

    def _firsts(self, fits: Sequence[TermFit], nothing: TermFit) -> list[TermFit]:
        """First terms to go on from: the best, and the best that share no equation with it."""
        found: list[TermFit] = []
        left = list(fits)
        while left and len(found) < STARTS:
            one = self._without_idle(self._simplest(left, nothing), nothing)
            if nothing.statistic - one.statistic < _least(nothing, LEAST_SHARE):
                break
            found.append(one)
            left = [other for other in left if not self._equations(other) & self._equations(one)]
        return found

    def _grown(self, best: TermFit, nothing: TermFit, tried: list[TermFit]) -> TermFit:
        """A fit with the terms added that it needs; what was fitted goes to `tried`."""
        while len(best.chosen) < MOST_TERMS and not self._is_adequate(best):
            fits = self._next(best)
            if not fits:
                break
            tried += fits
            better = self._without_idle(self._simplest(fits, nothing), nothing)
            own = self._problem.remainder * (nothing.statistic - better.statistic)
            if best.statistic - better.statistic < max(_least(best, LEAST_SHARE), own):
                break
            best = better
        return best

    def _next(self, about: TermFit) -> list[TermFit]:
        """Fits with a term or two more: of those whose signatures explain most of what is left."""
        scores = self._scores(about)
        fits = self._sharpened(self._added(about, scores, self._leaders(scores)))
        if fits and self._is_adequate(min(fits, key=attrgetter("price"))):
            return fits
        if MOST_TERMS - len(about.chosen) > 1:
            fits += self._sharpened(self._added(about, scores, self._pairs(scores)))
        return fits + self._tailored(about, scores)

    def _scores(self, about: TermFit) -> Scores:
        """Scores about a fit, further ones of the candidates that promise most by their first signatures."""
        if self._first is None:
            self._first = scores_of(self._problem, about, self._each)
            return self._first
        first = self._first
        again = scored(self._problem, first.numbers, first.slopes, about.residuals)
        promising = first.numbers[np.argsort(-again.validated)[:SHORTLIST]].tolist()
        new = range(int(np.max(first.numbers, initial=-1)) + 1, len(self._problem.candidates))
        return scores_of(self._problem, about, self._each, [*promising, *new])

    def _added(self, about: TermFit, scores: Scores, rows: Sequence[tuple[int, ...]]) -> list[TermFit]:
        """Fits with the candidates of these rows more."""
        return self._fits(lambda i: self._with(about, scores, rows[i]), len(rows))

    def _fits(self, fit: Callable[[int], TermFit | None], count: int) -> list[TermFit]:
        """Those that there are."""
        return [one for one in self._each(fit, range(count)) if isinstance(one, TermFit)]

    def _sharpened(self, fits: list[TermFit]) -> list[TermFit]:
        """Fits, and the best of them with the numbers within their laws fitted, too."""
        leaders = sorted(fits, key=attrgetter("price"))[:SHARPENED]

        def sharpened(i: int) -> TermFit | None:
            chosen = self._problem.sharpened(leaders[i].chosen, leaders[i].theta)
            return None if chosen is None else self._fit(chosen, leaders[i].theta)

        return fits + self._fits(sharpened, len(leaders))

    def _tailored(self, about: TermFit, scores: Scores) -> list[TermFit]:
        """Fits with a term more that is made for what is left."""
        promising = (self._equation(scores, row) for row in np.argsort(-scores.validated).tolist())
        made = self._problem.tailored(about, list(dict.fromkeys(promising)), self._each)

        def fitted(i: int) -> TermFit | None:
            return self._fit((*about.chosen, made[i]), np.append(about.theta, 0.0))

        fits = self._sharpened(self._fits(fitted, len(made)))
        if about.chosen or any(map(self._is_adequate, fits)):
            return fits
        made = self._problem.tabulated(about, self._each)
        return fits + self._sharpened(self._fits(fitted, len(made)))

    def _is_adequate(self, one: TermFit) -> bool:
        return self._problem.is_adequate(one.chosen, one.theta)

    def _leaders(self, scores: Scores) -> list[tuple[int, ...]]:
        """Rows of the best singles, but for those that another of their equation stands for."""
        leaders: list[tuple[int, ...]] = []
        for row in np.argsort(-scores.validated).tolist():
            if len(leaders) == REFITTED or scores.validated[row] <= 0.0:
                break
            if not any(
                self._equation(scores, row) == self._equation(scores, other)
                and scores.cosine(row, other) > SAME
                for (other,) in leaders
            ):
                leaders.append((row,))
        return leaders

    def _pairs(self, scores: Scores) -> list[tuple[int, ...]]:
        """Rows of the best pairs of one equation, where they are worth more than the best single."""
        limit = (1.0 + PAIR_SHARE) * float(np.max(scores.gains, initial=0.0)) + PAIR_GAIN
        promising = np.argsort(-scores.gains).tolist()
        worth = [
            (scores.pair_gain(one, other), (one, other))
            for one, other in combinations(promising, 2)
            if self._equation(scores, one) == self._equation(scores, other)
            and scores.cosine(one, other) < SAME
        ]
        worth.sort(reverse=True)
        return [rows for gain, rows in worth[:REFITTED_PAIRS] if gain > limit]

    def _equation(self, scores: Scores, row: int) -> str:
        return self._problem.candidates[int(scores.numbers[row])].equation

    def _with(self, about: TermFit, scores: Scores, rows: tuple[int, ...]) -> TermFit | None:
        """The fit with more terms, from what their signatures say of their sizes."""
        chosen = (*about.chosen, *(int(scores.numbers[row]) for row in rows))
        information = scores.information[np.ix_(rows, rows)]
        start = np.linalg.lstsq(information, scores.gradient[list(rows)], rcond=1e-9)[0]
        return self._fit(chosen, np.append(about.theta, start))

    def _fit(self, chosen: tuple[int, ...], start: NDArray[np.float64]) -> TermFit | None:
        """The fit of these terms, made once."""
        if chosen not in self._known:
            self._known[chosen] = self._found(chosen, start)
        return self._known[chosen]

    def _found(self, chosen: tuple[int, ...], start: NDArray[np.float64]) -> TermFit | None:
        ranges = [self._problem.candidates[number].range for number in chosen]
        for share in (1.0, 0.3):  # of what was scored, should the model have no solution there
            found = fit(_Sized(self._problem, chosen), share * start, ranges, ITERATIONS)
            if found is not None:
                return None if self._has_twins(chosen, found) else self._fitted(chosen, found)
        return None

    def _fitted(self, chosen: tuple[int, ...], found: Minimum) -> TermFit:
        spread = max(1.0, float(np.mean(found.residuals.z**2)))
        within = tuple(self._problem.candidates[number].numbers for number in chosen)
        return TermFit(chosen, found.theta, found.sigmas() * math.sqrt(spread), found.residuals, within)

    def _has_twins(self, chosen: tuple[int, ...], found: Minimum) -> bool:
        """Whether two terms of one equation stand for one: alike, or with a coefficient at its bound."""
        information, theta = found.at.information, found.theta
        terms = [self._problem.candidates[number] for number in chosen]
        return any(
            terms[one].equation == terms[other].equation
            and (
                information[one, other] ** 2 > SAME**2 * information[one, one] * information[other, other]
                or any(theta[i] in (terms[i].range.lowest, terms[i].range.highest) for i in (one, other))
            )
            for one, other in combinations(range(len(chosen)), 2)
        )

    def _simplest(self, fits: Sequence[TermFit], nothing: TermFit) -> TermFit:
        """The best fit, or one of fewer terms and equations, or with a name, that leaves but the model's own error.

        One that leaves nothing but noise comes before all that do not.
        """
        best = min(fits, key=attrgetter("price"))
        own = self._problem.remainder * (nothing.statistic - best.statistic)
        limit = best.price + max(own, TIE * best.spread)
        tied = sorted(
            (one for one in fits if one.price <= limit),
            key=lambda one: (len(one.chosen), len(self._equations(one)), one.by_table, one.price),
        )
        return next(filter(self._is_adequate, tied), tied[0])

    def _equations(self, one: TermFit) -> set[str]:
        return {self._problem.candidates[number].equation for number in one.chosen}

    def _without_idle(self, best: TermFit, nothing: TermFit) -> TermFit:
        """Without the terms that later ones have made needless."""
        for number in best.chosen:
            if len(best.chosen) < 2:
                break
            place = best.chosen.index(number)
            rest = tuple(one for one in best.chosen if one != number)
            smaller = self._fit(rest, np.delete(best.theta, place))
            if smaller is None:
                continue
            own = self._problem.remainder * (nothing.statistic - best.statistic)
            if smaller.statistic - best.statistic < max(_least(smaller, KEPT_SHARE), own):
                best = smaller
        return best

    def _is_rival(self, one: TermFit, best: TermFit) -> bool:
        """Whether it explains as much with no more terms, by another equation."""
        return (
            bool(best.chosen)
            and len(one.chosen) <= len(best.chosen)
            and self._equations(one) != self._equations(best)
            and one.statistic < best.statistic + TIE * best.spread
        )


class _Sized:
    """A problem with its terms chosen."""

    def __init__(self, problem: TermProblem, chosen: tuple[int, ...]) -> None:
        self._problem = problem
        self._chosen = chosen

    def residuals(self, theta: NDArray[np.float64]) -> Residuals | None:
        return self._problem.residuals(self._chosen, theta)


def _least(about: TermFit, share: float) -> float:
    """Least gain of a term: more, the more is left, and a share of that, as `statistic` counts it."""
    left = about.residuals.squares - about.residuals.z.size
    return max(LEAST_GAIN * about.spread, share * max(0.0, left))
