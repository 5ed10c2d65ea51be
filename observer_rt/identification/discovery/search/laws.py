"""The forward search for laws: refits the laws that would gain most beside a model, and adds those that pay."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from operator import attrgetter

import numpy as np

from observer_rt.engine.estimation.phases import Phase
from observer_rt.engine.learning.healthy import Healthy
from observer_rt.identification.discovery.search.adequacy import VARIANCE_LIMIT, healthy_level, worst
from observer_rt.identification.discovery.search.curves import CURVES, FreeCurve, free_curves, made_to_measure
from observer_rt.identification.discovery.search.fits import SAME, Fitter
from observer_rt.identification.discovery.search.hypothesis import Hypothesis, equation_of
from observer_rt.identification.discovery.search.results import Candidate
from observer_rt.identification.discovery.search.scores import Scores, scored
from observer_rt.identification.discovery.search.tables import tables
from observer_rt.identification.discovery.search.waves import lines, waves
from observer_rt.identification.likelihood.likelihood import Pool
from observer_rt.model.effect import Effect
from observer_rt.model.term_effect import TermLaw, term_effect
from observer_rt.model.terms.term import TermEquation

REFITTED, REFITTED_PAIRS = 5, 3  # of the best by score
PAIR_GAIN, PAIR_SHARE = 30.0, 0.05  # that a pair of one equation must gain over the best single to be fitted
TIE = 16.0  # of -2 log L, within which fits explain as much
LEAST_GAIN, LEAST_SHARE = 25.0, 0.05  # of what is left unexplained, that a further effect must gain
KEPT_SHARE = 0.02  # of the same, that one already taken must be worth
MOST_TOGETHER = 3
MOST_NAMED = 3  # numbers within a law that has a name: a table has more
SHORTLIST = 40  # of further effects that are linearised again
STARTS = 2  # first effects from which others are sought, where the best ends inadequate
SHARPENED = 2  # best fits, in which the numbers within laws are fitted, too
TAILORED_FURTHER = 2  # most promising equations, in which laws of further terms are made to measure
REMAINDER = 0.06  # of what there was, that a fitted model may leave: a law is no more exact than it is
EXACT = 1e-3  # of the same, that an exact model may leave: steps and samples are not finer
_LOSSES = {TermEquation.LINE_FLOW, TermEquation.RAIL_PRESSURE}
_ALIKE = (
    {TermEquation.LINE_FLOW, TermEquation.INERTANCE},
    _LOSSES,
    {TermEquation.SEAT_FLOW, TermEquation.NEEDLE_LIFT},
    {TermEquation.SEAT_FLOW, TermEquation.NOZZLE_FLOW},
    {TermEquation.NOZZLE_FLOW, TermEquation.CHAMBER_PRESSURE},
    {TermEquation.LINE_PRESSURE, TermEquation.NEEDLE_LIFT},
    {TermEquation.LINE_PRESSURE_SENSOR, TermEquation.RAIL_PRESSURE},
    {TermEquation.LINE_PRESSURE_SENSOR, TermEquation.NEEDLE_LIFT},
    {TermEquation.STIFFNESS, TermEquation.INERTANCE},
)
"""Equations of which some laws do the same to the line pressure, or nearly."""


@dataclass(frozen=True, eq=False)
class Laws:
    """Result of a search for laws.

    best: effects found, none where nothing is worth one; adequate: whether it leaves nothing but noise; rivals: of
    other equations, the best fit of as many effects that explains as much; tried: all that was fitted.
    """

    best: Candidate
    adequate: bool
    rivals: tuple[Candidate, ...]
    tried: tuple[Candidate, ...] = ()


class Adequacy:
    """Whether candidates leave nothing but noise, or the model's own error."""

    def __init__(self, fits: Fitter, healthy: Healthy) -> None:
        self._fits, self._healthy = fits, healthy
        self.remainder = REMAINDER if healthy.appears else EXACT
        """Share of what effects explain that may be the model's own error."""

    def ratio(self, candidate: Candidate) -> float:
        """Ratio of a candidate's worst phase to its limit; above 1 it does not explain the recordings."""
        pool = self._fits.pool(candidate)
        return np.inf if pool is None else worst(pool, self._healthy).ratio

    def __call__(self, candidate: Candidate) -> bool:
        """Whether a candidate with laws explains the recordings, but for the model's own error."""
        pool = self._fits.pool(candidate)
        if pool is None:
            return False
        return self.ratio(candidate) <= 1.0 or bool(candidate.hypothesis.effects and self._is_remainder(pool))

    def _is_remainder(self, pool: Pool) -> bool:
        """Whether so little is left of what there was in every phase that it may be the model's own error."""
        before = self._fits.pool(self._fits.nothing())
        assert before is not None  # the search began with it
        for signal, statistics in pool.items():
            for phase in Phase:
                healthy = VARIANCE_LIMIT[signal] * healthy_level(self._healthy, signal, phase)[0]
                excess = statistics.variance(phase) - healthy
                if excess > self.remainder * max(0.0, before[signal].variance(phase) - healthy):
                    return False
        return True


class LawSearch:
    """Adds effects one after another, or two of one equation at once, until nothing but noise is left."""

    def __init__(self, fits: Fitter, effects: Sequence[Effect], adequate: Adequacy) -> None:
        """effects: with one size each, of the library and of the vocabulary."""
        self._fits, self._effects, self._is_adequate = fits, tuple(effects), adequate
        self._nothing = fits.nothing()
        self._curves: dict[tuple[tuple[str, ...], tuple[TermEquation, ...]], list[FreeCurve]] = {}

    @cached_property
    def _alone(self) -> list[Candidate]:
        """Fits of an effect, or two of one equation, beside nothing else."""
        return self._next(self._nothing)

    @cached_property
    def enough(self) -> Candidate | None:
        """The simplest effect, or two of one equation, that explains the recordings alone."""
        best = self._simplest(self._alone)
        return best if self._is_adequate(best) else None

    def run(self, near: Sequence[Candidate] = ()) -> Laws:
        """See `Laws`. near: found together before, to which one may be wanting."""
        best, tried = self._nothing, list[Candidate]()
        adequate = self._is_adequate(best)
        if not adequate:
            tried = [*self._alone]
            firsts = [*self._firsts(tried), *near]
            for first in sorted(
                firsts, key=lambda candidate: (not self._is_adequate(candidate), candidate.price)
            ):
                grown = self._grown(first, tried)
                if grown in near:  # found wanting as it is: only what comes to it counts
                    continue
                is_adequate = self._is_adequate(grown)
                if (not is_adequate, grown.price) < (not adequate, best.price):
                    best, adequate = grown, is_adequate
                if adequate and (len(best.ids) < MOST_TOGETHER or first in near):
                    break
        tried += self._mirrored(best)
        rivals: dict[frozenset[str], Candidate] = {}
        for candidate in sorted(tried, key=attrgetter("price")):
            if self._is_rival(candidate, best):
                rivals.setdefault(candidate.hypothesis.equations, candidate)
        return Laws(best, adequate, tuple(rivals.values()), tuple(tried))

    def _firsts(self, fits: Sequence[Candidate]) -> list[Candidate]:
        """First effects to go on from: the best, and the best that share no equation with it."""
        firsts: list[Candidate] = []
        left = list(fits)
        while left and len(firsts) < STARTS:
            candidate = self._without_idle(self._simplest(left))
            if self._nothing.statistic - candidate.statistic < self._least(self._nothing, LEAST_SHARE):
                break
            firsts.append(candidate)
            left = [
                other for other in left if not other.hypothesis.equations & candidate.hypothesis.equations
            ]
        return firsts

    def _grown(self, best: Candidate, tried: list[Candidate]) -> Candidate:
        """A fit with the effects added that it needs; what was fitted goes to `tried`."""
        while len(best.ids) < MOST_TOGETHER and not self._is_adequate(best):
            fits = self._next(best)
            if not fits:
                break
            tried += fits
            better = self._without_idle(self._simplest(fits))
            if best.statistic - better.statistic < max(self._least(best, LEAST_SHARE), self._own(better)):
                break
            best = better
        return best

    def _next(self, about: Candidate) -> list[Candidate]:
        """Fits with an effect or two more: those whose signatures explain most of the residuals."""
        scores = self._scores(about)
        fits = self._sharpened(self._added(about, scores, self._leaders(scores)))
        if fits and self._is_adequate(min(fits, key=attrgetter("price"))):
            return fits
        if MOST_TOGETHER - len(about.ids) > 1:
            fits += self._sharpened(self._added(about, scores, self._pairs(scores)))
        return fits + self._tailored(about, scores)

    def _scores(self, about: Candidate) -> Scores:
        """Scores about a fit, further ones of the effects that promise most by their first signatures."""
        if not about.ids:
            return self._first
        again = self._scored_again(about)
        promising = (again.effects[row] for row in np.argsort(-again.validated).tolist())
        others = [one for one in promising if one.id not in about.ids]
        return self._fits.scores(about, others[:SHORTLIST])

    @cached_property
    def _first(self) -> Scores:
        """Scores of all effects about the model as it is."""
        return self._fits.scores(self._nothing, self._effects)

    def _scored_again(self, about: Candidate) -> Scores:
        """Scores about a fit by the first signatures."""
        first, here = self._first, self._fits.residuals(about)
        assert here is not None  # it was fitted
        return scored(first.effects, first.numbers, first.slopes, here)

    def _added(self, about: Candidate, scores: Scores, rows: Sequence[tuple[int, ...]]) -> list[Candidate]:
        """Fits with the effects of these rows more, from what their signatures say of their sizes."""
        return self._fits.laws(
            [
                (
                    Hypothesis((*about.hypothesis.effects, *(scores.effects[row] for row in some))),
                    np.append(about.theta, scores.sizes(some)),
                )
                for some in rows
            ]
        )

    def _sharpened(self, fits: list[Candidate]) -> list[Candidate]:
        """Fits, and the best of them with the numbers within their laws fitted, too."""
        leaders = sorted(fits, key=attrgetter("price"))[:SHARPENED]
        return fits + [one for one in self._fits.map(self._fits.sharpened, leaders) if one is not None]

    def _tailored(self, about: Candidate, scores: Scores) -> list[Candidate]:
        """Fits with another effect, made for the residuals: a law, else a table."""
        promising = dict.fromkeys(equation_of(scores.effects[row]) for row in np.argsort(-scores.validated))
        promising_equations = [TermEquation(one) for one in promising if one in set(TermEquation)]
        where = tuple(promising_equations[:TAILORED_FURTHER] if about.ids else CURVES)

        def of_curves(equations: tuple[TermEquation, ...]) -> list[FreeCurve]:
            key = about.ids, equations
            if key not in self._curves:
                every = [(equation, *one) for equation in equations for one in CURVES.get(equation, ())]
                self._curves[key] = free_curves(every, score)
            return self._curves[key]

        def fitted(made: Sequence[Effect]) -> list[Candidate]:
            start = np.append(about.theta, 0.0)
            return self._sharpened(
                self._fits.laws([(about.hypothesis.with_effect(one), start) for one in made])
            )

        def score(effects: Sequence[Effect]) -> Scores:
            return self._fits.scores(about, effects)

        fits = fitted(made_to_measure(of_curves(where), self._waves(about), score))
        if about.ids or any(map(self._is_adequate, fits)):
            return fits
        return fits + fitted(tables(of_curves(tuple(CURVES)), score))

    def _waves(self, about: Candidate) -> list[tuple[Effect, Effect]]:
        """Waves of frequencies that stand out of what a candidate leaves."""
        here, recordings = self._fits.residuals(about), self._fits.likelihood.recordings
        assert here is not None  # it was fitted
        by_group = np.split(here.z, np.cumsum(here.counts)[:-1])  # line pressure and rate in turn
        times = [recorded.times for recorded in recordings]
        frequencies = lines(by_group[::2], times, recordings[0].measurement.interval)
        return waves(frequencies, max(float(one[-1] - one[0]) for one in times))

    def _mirrored(self, best: Candidate) -> list[Candidate]:
        """Laws of the form of the best one in equations that line pressure hardly tells from its own."""
        law = best.hypothesis.effects[0].apply if len(best.ids) == 1 else None
        if not isinstance(law, TermLaw):
            return []
        others = [other for other in TermEquation if {law.equation, other} in _ALIKE]
        if self._fits.nominal.injector.line.model == "lump":  # what is lost along it is lost at its inlet
            others = [other for other in others if {law.equation, other} != _LOSSES]
        alike = [(Hypothesis((term_effect(other, law.form, law.numbers),)), np.zeros(1)) for other in others]
        half = 0.5 * (self._nothing.statistic - best.statistic)
        promising = [one for one in self._fits.laws(alike) if one.statistic < best.statistic + half]
        sharp = self._fits.map(self._fits.sharpened, promising)
        return promising + [one for one in sharp if one is not None]

    def _leaders(self, scores: Scores) -> list[tuple[int, ...]]:
        """Rows of the best singles, but for those that another of their equation stands for."""
        leaders: list[tuple[int, ...]] = []
        for row in np.argsort(-scores.validated).tolist():
            if len(leaders) == REFITTED or scores.validated[row] <= 0.0:
                break
            if not any(
                equation_of(scores.effects[row]) == equation_of(scores.effects[other])
                and scores.cosine(row, other) > SAME
                for (other,) in leaders
            ):
                leaders.append((row,))
        return leaders

    def _pairs(self, scores: Scores) -> list[tuple[int, ...]]:
        """Rows of the best pairs of one equation, where they are worth more than the best single."""
        limit = (1.0 + PAIR_SHARE) * float(np.max(scores.gains, initial=0.0)) + PAIR_GAIN
        equations = [equation_of(effect) for effect in scores.effects]
        worth = [
            (scores.pair_gain(one, other), (one, other))
            for one, other in combinations(np.argsort(-scores.gains).tolist(), 2)
            if equations[one] == equations[other] and scores.cosine(one, other) < SAME
        ]
        worth.sort(reverse=True)
        return [rows for gain, rows in worth[:REFITTED_PAIRS] if gain > limit]

    def _simplest(self, fits: Sequence[Candidate]) -> Candidate:
        """The best fit, or one of fewer effects and equations, or with a name, that leaves but the model's own error.

        One that leaves nothing but noise comes before all that do not.
        """
        best = min(fits, key=attrgetter("price"))
        limit = best.price + max(self._own(best), TIE * best.spread)
        tied = sorted(
            (one for one in fits if one.price <= limit),
            key=lambda one: (len(one.ids), len(one.hypothesis.equations), is_by_table(one), one.price),
        )
        return next(filter(self._is_adequate, tied), tied[0])

    def _without_idle(self, best: Candidate) -> Candidate:
        """Without the effects that later ones have made needless."""
        for effect in best.hypothesis.effects:
            if len(best.ids) < 2:
                break
            index = best.hypothesis.effects.index(effect)
            others = Hypothesis(tuple(one for one in best.hypothesis.effects if one is not effect))
            for smaller in self._fits.laws([(others, np.delete(best.theta, index))]):
                if smaller.statistic - best.statistic < max(
                    self._least(smaller, KEPT_SHARE), self._own(best)
                ):
                    best = smaller
        return best

    def _is_rival(self, candidate: Candidate, best: Candidate) -> bool:
        """Whether it explains as much with no more effects, by another equation."""
        return (
            bool(best.ids)
            and len(candidate.ids) <= len(best.ids)
            and candidate.hypothesis.equations != best.hypothesis.equations
            and candidate.statistic < best.statistic + TIE * best.spread
        )

    def _own(self, candidate: Candidate) -> float:
        """Share of a candidate's gain that may be the model's own error."""
        return self._is_adequate.remainder * (self._nothing.statistic - candidate.statistic)

    def _least(self, about: Candidate, share: float) -> float:
        """Least gain of an effect: more, the more is left, and a share of that, as `statistic` counts it."""
        samples = sum(int(one.phases.size + one.rate_phases.size) for one in self._fits.likelihood.recordings)
        return max(LEAST_GAIN * about.spread, share * (about.spread - 1.0) * samples)


def is_by_table(candidate: Candidate) -> bool:
    """Whether a law is a table."""
    return max(candidate.hypothesis.numbers, default=0) > MOST_NAMED
