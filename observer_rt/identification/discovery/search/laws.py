"""Laws beside a candidate: the best of one linearised pass are refitted, and others are made for its residuals.

The law guessed of what the network learned is refitted first, at no better odds: the recordings would count twice.
"""

from collections.abc import Sequence
from functools import cached_property, partial
from itertools import combinations
from operator import attrgetter

import numpy as np

from observer_rt.engine.estimation.parameters import NOZZLE, SEAT
from observer_rt.engine.reports.learned_laws import LearnedLaw, leading
from observer_rt.identification.discovery.search import curves
from observer_rt.identification.discovery.search.adequacy import Adequacy
from observer_rt.identification.discovery.search.candidates import LAW_ODDS, Candidate, Hypothesis, equation_of
from observer_rt.identification.discovery.search.fits import SAME_COSINE, Fitter
from observer_rt.identification.discovery.search.library import library, span_of
from observer_rt.identification.discovery.search.scores import Scores, scored
from observer_rt.identification.discovery.search.tables import NO_SYMMETRY, products, tables, validated
from observer_rt.model.effect import Effect
from observer_rt.model.term_effect import COMPONENTS, TermLaw, term_effect
from observer_rt.model.terms.term import TermEquation
from observer_rt.model.terms.variable import Variable

MOST_EFFECTS = 3  # of a candidate
MOST_SINGLES, MOST_PAIRS = 5, 3  # of the best by score
PAIR_GAIN, PAIR_SHARE = 30.0, 0.05  # that a pair of one equation must gain over the best single to be fitted
SHORTLIST_LENGTH = 40  # of further laws that are linearised again
MOST_SHARPENED = 2  # best fits, in which the numbers within laws are fitted, too
OTHER_FORM_SHARE = 5e-3  # of what a name explains, that a curve beside it must gain: beside right names .001 at most
TAILORED_EQUATIONS = 2  # most promising equations, in which laws of further terms are made to measure
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
ALL_CURVES = [curves.Curve(equation, *one) for equation, over in curves.CURVES.items() for one in over]
EQUATIONS = {NOZZLE: TermEquation.NOZZLE_FLOW, SEAT: TermEquation.SEAT_FLOW}
VARIABLES = {
    "pressure_drop_MPa": Variable.SAC_PRESSURE,
    "seat_area_mm2": Variable.NEEDLE_LIFT,
    "time_since_opening_ms": Variable.TIME_SINCE_OPENING,
    "rail_pressure_MPa": Variable.RAIL_PRESSURE,
}


Guess = LearnedLaw | None


class Laws:
    """Fits with one law more, or one name with one size, for such names are treated as laws."""

    def __init__(self, fits: Fitter, names: Sequence[Effect], adequate: Adequacy, guess: Guess) -> None:
        self._fits, self._is_adequate, self._guess = fits, adequate, guess
        self._names = [one for one in names if len(one.parameters) == 1]
        self._nothing = fits.nothing()
        self._first: Scores | None = None  # of all laws beside nothing
        self._scored: dict[tuple[str, ...], Scores] = {}  # beside the last candidate

    def promise(self, about: Candidate) -> float:
        """Gain of the best single law beside a candidate, each part of the data judged by the others."""
        return float(np.max(self._scores(about).validated, initial=0.0))

    @cached_property
    def _effects(self) -> tuple[Effect, ...]:
        return (*library(span_of(self._fits.likelihood)), *self._names)

    def _scores(self, about: Candidate) -> Scores:
        """Scores beside a candidate; after a first pass over all laws, only those that promised most are scored."""
        if not about.ids:
            self._first = self._first or self._fits.scores(self._nothing, self._effects)
            return self._first
        if about.ids not in self._scored:
            effects = self._effects if self._first is None else self._shortlist(about, self._first)
            self._scored = {about.ids: self._fits.scores(about, [one for one in effects if one.id not in about.ids])}
        return self._scored[about.ids]

    def _shortlist(self, about: Candidate, first: Scores) -> tuple[Effect, ...]:
        again = scored(first.effects, first.numbers, first.slopes, self._fits.residuals(about))
        return tuple(first.effects[row] for row in np.argsort(-again.validated)[: SHORTLIST_LENGTH + len(about.ids)])

    def fits_with(self, about: Candidate) -> list[Candidate]:
        """Fits with a law more, or two of one equation, whose slopes explain most of the residuals."""
        scores = self._scores(about)
        fits = self._sharpened(self._added(about, scores, self._leaders(scores)))
        if fits and self._is_adequate(min(fits, key=attrgetter("price"))):
            return fits
        if MOST_EFFECTS - len(about.ids) > 1:
            fits += self._sharpened(self._added(about, scores, self._pairs(scores)))
        return fits + (self._tailored(about, scores) if about.ids else self.made_alone)

    def _added(self, about: Candidate, scores: Scores, rows: Sequence[tuple[int, ...]]) -> list[Candidate]:
        """Fits with the effects of these rows more, begun at the sizes by their scores."""
        starts = []
        for some in rows:
            effects = (*about.hypothesis.effects, *(scores.effects[row] for row in some))
            starts.append((Hypothesis(effects), np.append(about.theta, scores.sizes(some))))
        return self._fits.laws(starts)

    def _sharpened(self, fits: list[Candidate]) -> list[Candidate]:
        """The fits, and the best of them again with the numbers within their laws free."""
        return fits + self._freed(sorted(fits, key=attrgetter("price"))[:MOST_SHARPENED])

    def _freed(self, fits: Sequence[Candidate]) -> list[Candidate]:
        return [one for one in self._fits.map(self._fits.sharpened, fits) if one is not None]

    def _tailored(self, about: Candidate, scores: Scores) -> list[Candidate]:
        """Fits with an effect made for the residuals: a law, else a product, else a table."""
        score = partial(self._fits.scores, about)
        free = curves.free_curves(_promising_curves(scores) if about.ids else ALL_CURVES, score)
        fits = self._fitted_beside(about, curves.made_to_measure(free, self._waves(about), score))
        is_pair_guessed = self._guess is not None and self._guess.is_surface
        if about.ids or (any(map(self._is_adequate, fits)) and not is_pair_guessed):
            return fits
        fits += self._products_alone
        return fits if any(map(self._is_adequate, fits)) else fits + self._fitted_beside(about, tables(free, score))

    def _fitted_beside(self, about: Candidate, made: Sequence[Effect]) -> list[Candidate]:
        start = np.append(about.theta, 0.0)
        return self._sharpened(self._fits.laws([(about.hypothesis.with_effect(one), start) for one in made]))

    def _waves(self, about: Candidate) -> list[tuple[Effect, Effect]]:
        recordings = self._fits.likelihood.recordings
        left, times = [judged.z for judged in self._fits.judged(about)], [recorded.times for recorded in recordings]
        frequencies = curves.lines(left, times, recordings[0].measurement.interval)
        return curves.waves(frequencies, max(float(one[-1] - one[0]) for one in times))

    @cached_property
    def made_alone(self) -> list[Candidate]:
        """Fits with a single law or table made for the residuals of the model as given."""
        return self._tailored(self._nothing, self._scores(self._nothing))

    @cached_property
    def _products_alone(self) -> list[Candidate]:
        guessed = partial(is_guessed, guess=self._guess)
        return self._fitted_beside(self._nothing, products(partial(self._fits.scores, self._nothing), guessed))

    def stand_ins(self, best: Candidate) -> list[Candidate]:
        """Laws that alone explain half of what a single effect does; instead of a law, much better products, too."""
        law, pairs = best.hypothesis.effects[0].apply, list[Candidate]()
        if isinstance(law, TermLaw):
            pairs = [pair for pair in self._products_alone if pair.price < best.price - LAW_ODDS]
            made = self._instead_of_law(law)
        else:
            made = self._made_over(self._unlike(best))
        half = 0.5 * (self._nothing.statistic - best.statistic)
        alone = [(Hypothesis((effect,)), np.zeros(1)) for effect in made]
        promising = [law for law in self._fits.laws(alone) if law.statistic < best.statistic + half]
        return promising + self._freed(promising) + pairs

    def _instead_of_law(self, law: TermLaw) -> list[Effect]:
        """Laws over its variable in other equations, and its form where the line pressure hardly tells it apart."""
        axis = curves.axis_of(law.law)
        over = [curve for curve in ALL_CURVES if curve.axis is axis and curve.equation is not law.equation]
        alike = [other for other in TermEquation if {law.equation, other} in _ALIKE]
        if self._fits.nominal.injector.line.model == "lump":  # what is lost along it is lost at its inlet
            alike = [other for other in alike if {law.equation, other} != _LOSSES]
        return [*self._made_over(over), *(term_effect(other, law.form, law.numbers) for other in alike)]

    def _made_over(self, chosen: Sequence[curves.Curve]) -> list[Effect]:
        score = partial(self._fits.scores, self._nothing)
        return curves.made_to_measure(curves.free_curves(chosen, score), (), score) if chosen else []

    def _unlike(self, name: Candidate) -> list[curves.Curve]:
        """Curves at a name's place that gain a law's price beside it; beside a right name no form gains that much."""
        own = [one for one in ALL_CURVES if COMPONENTS[one.equation] is name.hypothesis.effects[0].component]
        explained = self._nothing.statistic - name.statistic
        least = max(LAW_ODDS * name.spread, min(OTHER_FORM_SHARE, self._is_adequate.remainder) * explained)
        free = curves.free_curves(own, partial(self._fits.scores, name)) if own else []
        return [one.curve for one in free if validated(one, NO_SYMMETRY, range(one.knots.size)) > least]

    def _leaders(self, scores: Scores) -> list[tuple[int, ...]]:
        """Rows of the best single laws, a guessed one first; of laws of one equation that are alike only the best."""
        leaders: list[tuple[int, ...]] = []
        ranked = [row for row in np.argsort(-scores.validated).tolist() if scores.validated[row] > 0.0]
        guessed = [row for row in ranked if is_guessed(scores.effects[row], self._guess)]
        for row in (*guessed[:1], *ranked):
            if len(leaders) == MOST_SINGLES:
                break
            if not any(
                equation_of(scores.effects[row]) == equation_of(scores.effects[other])
                and scores.cosine(row, other) > SAME_COSINE
                for (other,) in leaders
            ):
                leaders.append((row,))
        return leaders

    def _pairs(self, scores: Scores) -> list[tuple[int, ...]]:
        """Rows of the best pairs of one equation, if they are worth more than the best single law."""
        limit = (1.0 + PAIR_SHARE) * float(np.max(scores.gains, initial=0.0)) + PAIR_GAIN
        equations = [equation_of(effect) for effect in scores.effects]
        worth = [
            (float(scores.gradient[[*pair]] @ scores.sizes(pair)), pair)
            for pair in combinations(np.argsort(-scores.gains).tolist(), 2)
            if len({equations[row] for row in pair}) == 1 and scores.cosine(*pair) < SAME_COSINE
        ]
        worth.sort(reverse=True)
        return [rows for gain, rows in worth[:MOST_PAIRS] if gain > limit]


def _promising_curves(scores: Scores) -> list[curves.Curve]:
    ranked = dict.fromkeys(equation_of(scores.effects[row]) for row in np.argsort(-scores.validated))
    equations = [one for one in ranked if one in set(TermEquation)][:TAILORED_EQUATIONS]
    return [curve for curve in ALL_CURVES if curve.equation in equations]


def is_guessed(effect: Effect, guess: Guess) -> bool:
    """Whether an effect is a law of the guessed flow over the guessed input."""
    law = effect.apply
    if guess is None or not isinstance(law, TermLaw) or law.equation is not EQUATIONS[guess.flow]:
        return False
    return {VARIABLES[variable] for variable in guess.variables} <= law.law.variables


def guess_words(laws: Sequence[LearnedLaw]) -> str:
    """Names the law that the search began with."""
    guess = leading(laws)
    if guess is None:
        return "None is further from level than its interval."
    over = " and ".join(VARIABLES[variable].word for variable in guess.variables)
    return f"The search began with {EQUATIONS[guess.flow].words} over {over}."
