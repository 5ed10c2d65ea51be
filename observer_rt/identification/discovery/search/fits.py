"""Fits of explanations: each made once, several at a time, and what any further effect would gain beside them."""

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import combinations, product
from operator import attrgetter, itemgetter
from types import MappingProxyType
from typing import TypeVar

import numpy as np

from observer_rt.foundation.units import Floats
from observer_rt.identification.discovery.search import candidates
from observer_rt.identification.discovery.search.candidates import Candidate, CandidateKey, Hypothesis
from observer_rt.identification.discovery.search.scores import SWITCH_SIZE, Scores, WeightedSlopes, bounds_of, scored
from observer_rt.identification.likelihood import appearance, bounded_fit
from observer_rt.identification.likelihood.bounded_fit import MAX_ITERATIONS, Minimum, Problem, Residuals, fit
from observer_rt.identification.likelihood.likelihood import JointLikelihood, JudgedModel, residuals_of
from observer_rt.identification.likelihood.signals import Pool, pool_of
from observer_rt.model.baseline import Appearance
from observer_rt.model.effect import Effect
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.term_effect import form_freed, form_settled, is_term
from observer_rt.model.terms.term import TermEquation

ROUGH_ITERATIONS = 3  # of the first fit of every effect
ROUGH_SHARE = 0.5  # of what the best single explains: those that leave more of it unexplained stay rough
ALWAYS_REFINED = 4  # leaders
LAW_ITERATIONS, FREED_ITERATIONS = 6, 8  # of a fit of laws, and with the numbers within them free
MOST_NAMED = 3  # numbers within a law that has a name: a table has more
SAME_COSINE = 0.998  # cosine of two slopes of one equation, from which on they stand for one
NEAR_GAIN = 40.0  # of -2 log L beyond which a candidate takes nothing from the confidence in another

KEPT_SAMPLES = 20_000_000  # judged ones that are kept, 160 MB of them, so that nothing is simulated twice
LEAST_KEPT = 24  # judged models, however long recordings are

ROUGH, FREED = "rough", "freed"

_TINY = 1e-30
_UNKNOWN: list[JudgedModel] = []
_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


class Fitter:
    """Fits hypotheses to the likelihood on several threads (the compiled prediction runs without the lock)."""

    def __init__(
        self,
        likelihood: JointLikelihood,
        nominal: EffectiveModel,
        workers: int = 1,
        on_fit: Callable[[Candidate], None] | None = None,
        appears: Mapping[str, Appearance] = MappingProxyType({}),
    ) -> None:
        """on_fit: called with every new fit; appears: apparent effects of the healthy injector by id."""
        self.likelihood, self.nominal = likelihood, nominal
        self._workers, self._on_fit, self._appears = workers, on_fit, appears
        # by ids, and ROUGH or FREED; not by the start: residuals hardly bend over sizes, so there is one minimum
        self._fits: dict[tuple[str, ...], Candidate | None] = {}
        self.signatures: dict[str, appearance.Signature] = {}
        self._sigmas: dict[CandidateKey, Floats] = {}
        self._judged: dict[CandidateKey, list[JudgedModel] | None] = {}
        samples = sum(one.phases.size + one.rate_phases.size for one in likelihood.recordings)
        self._most_kept = max(LEAST_KEPT, KEPT_SAMPLES // samples)
        self._pools: dict[CandidateKey, Pool] = {}

    def nothing(self) -> Candidate:
        residuals = self._problem(Hypothesis())(np.zeros(0))
        assert residuals is not None  # the search began with it
        return Candidate(Hypothesis(), (), residuals.statistic, residuals.spread)

    def measure(self, effects: Sequence[Effect]) -> None:
        """Fill `signatures` with those of the effects beside the nominal model."""
        judged = self.judged(self.nothing())

        def judge(effect: Effect, sizes: tuple[float, ...]) -> list[JudgedModel] | None:
            return self._judged_at(Hypothesis((effect,)), np.array(sizes))

        signatures = self.map(lambda effect: appearance.signature_of(effect, judged, judge), effects)
        self.signatures = {one.effect.id: one for one in signatures if one is not None}

    def reference(self, effect: Effect) -> tuple[float, float]:
        """Mean and sigma of an effect's size on the healthy injector, as these recordings see it."""
        signature = self.signatures.get(effect.id)
        return (0.0, 0.0) if signature is None else appearance.reference(self._appears, signature)

    def judged(self, candidate: Candidate) -> list[JudgedModel]:
        """A candidate on every recording."""
        judged = self._judged_at(candidate.hypothesis, candidate.theta)
        assert judged is not None  # it was fitted
        return judged

    def _judged_at(self, hypothesis: Hypothesis, theta: Floats) -> list[JudgedModel] | None:
        key = hypothesis.ids, tuple(theta.tolist())
        if (kept := self._judged.get(key, _UNKNOWN)) is not _UNKNOWN:
            return kept
        judged = self._judged[key] = self.likelihood.judge(hypothesis.model(self.nominal, theta))
        for old in list(self._judged)[: -self._most_kept]:
            self._judged.pop(old, None)
        return judged

    def pool(self, candidate: Candidate) -> Pool:
        """Statistics of a candidate's residuals by signal and phase."""
        if candidate.key not in self._pools:
            self._pools[candidate.key] = pool_of(self.likelihood.recordings, self.judged(candidate))
        return self._pools[candidate.key]

    def residuals(self, candidate: Candidate) -> Residuals:
        return residuals_of(self.judged(candidate))

    def _problem(self, hypothesis: Hypothesis) -> Problem:
        def residuals(theta: Floats) -> Residuals | None:
            judged = self._judged_at(hypothesis, theta)
            return None if judged is None else residuals_of(judged)

        return residuals

    def sigmas(self, candidate: Candidate) -> Floats:
        """Standard deviations of a candidate's sizes by noise; inf for sizes without information."""
        if candidate.key not in self._sigmas:
            hypothesis, residuals = candidate.hypothesis, self.residuals(candidate)
            at = bounded_fit.linearise(self._problem(hypothesis), candidate.theta, residuals, hypothesis.ranges())
            spread = np.sqrt(max(1.0, float(np.mean(residuals.z**2))))
            self._sigmas[candidate.key] = bounded_fit.sigmas_of(at.information) * spread
        return self._sigmas[candidate.key]

    def map(self, work: Callable[[_Item], _Result], items: Sequence[_Item]) -> list[_Result]:
        """Results of `work` in the order of the items; an interruption cancels those not begun."""
        with ThreadPoolExecutor(self._workers) as pool:
            try:
                return list(pool.map(work, items))
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise

    def scores(self, about: Candidate, effects: Sequence[Effect]) -> Scores:
        """Scores of further effects beside a candidate, by small sizes, and by larger ones of effects with a name."""
        here = self.residuals(about)
        weights = here.roots
        left = np.asarray(weights * here.z, np.float32)

        def slope_by(effect: Effect) -> WeightedSlopes | None:
            both, probed = about.hypothesis.with_effect(effect), list[tuple[float, WeightedSlopes]]()
            for sizes in _probes(effect, both.ranges()[-1].step if effect.parameters else SWITCH_SIZE):
                moved = self._problem(both)(np.append(about.theta, sizes[: len(effect.parameters)]))
                if moved is not None:
                    slope = np.asarray(weights * (here.z - moved.z) / sizes[0], np.float32)
                    gain = max(float(slope @ left) * math.copysign(1.0, sizes[0]), 0.0) ** 2
                    probed.append((gain / max(float(slope @ slope), _TINY), slope))
                if probed and is_term(effect) and candidates.equation_of(effect) != TermEquation.NEEDLE_LIFT:
                    break  # a needle is shut or open: its two directions differ
            return max(probed, key=itemgetter(0))[1] if probed else None

        tried = enumerate(self.map(slope_by, effects))
        by_number = {number: slope for number, slope in tried if slope is not None and slope.any()}
        slopes = np.array([*by_number.values()], np.float32).reshape(-1, here.z.size).T
        return scored([effects[number] for number in by_number], np.array([*by_number], np.int64), slopes, here)

    def laws(self, hypotheses: Sequence[tuple[Hypothesis, Floats]]) -> list[Candidate]:
        """Fits of laws, perhaps beside effects of one size, each from its start; without those that fail."""
        return [one for one in self.map(lambda item: self._law(*item), hypotheses) if one is not None]

    def _law(self, hypothesis: Hypothesis, start: Floats) -> Candidate | None:
        def minimum_of_law() -> Minimum | None:
            problem, ranges = self._problem(hypothesis), hypothesis.ranges()
            for share in (1.0, 0.3):  # of what was scored, should the model have no solution there
                minimum = fit(problem, share * start, ranges, LAW_ITERATIONS)
                if minimum is not None:
                    return None if _has_twins(hypothesis, minimum) else minimum
            return None

        return self._remembered(hypothesis, hypothesis.ids, minimum_of_law)

    def sharpened(self, candidate: Candidate) -> Candidate | None:
        """A candidate with the numbers within its laws, or of a table alone, fitted, too; None if that fails."""
        effects, numbers = candidate.hypothesis.effects, candidate.hypothesis.numbers
        few = [len(effects) == 1 or number <= MOST_NAMED for number in numbers]
        freed = Hypothesis(tuple(form_freed(one) if free else one for one, free in zip(effects, few, strict=True)))
        if len(freed.parameters) == len(candidate.sizes):
            return None
        start = [
            np.append(sizes, [p.starts[0] for p in effect.parameters[sizes.size :]])
            for effect, (_, sizes, _) in zip(freed.effects, candidate.parts, strict=True)
        ]
        search = partial(fit, self._problem(freed), np.concatenate(start), freed.ranges(), FREED_ITERATIONS)
        fit_of_form = self._remembered(freed, (*candidate.ids, FREED), search)
        if fit_of_form is None:
            return None
        settled = tuple(
            form_settled(effect, values[1:].tolist()) if is_term(effect) and values.size > 1 else effect
            for effect, values in zip(effects, freed.split(fit_of_form.theta), strict=True)
        )
        return self._law(Hypothesis(settled), candidate.theta)

    def _remembered(
        self, hypothesis: Hypothesis, key: tuple[str, ...], search: Callable[[], Minimum | None]
    ) -> Candidate | None:
        if key not in self._fits:
            minimum, candidate = search(), None
            if minimum is not None:
                sizes, spread = tuple(minimum.theta.tolist()), minimum.residuals.spread
                candidate = Candidate(hypothesis, sizes, minimum.statistic, spread)
                if self._on_fit is not None:
                    self._on_fit(candidate)
            self._fits[key] = candidate
        kept = self._fits[key]
        return None if kept is None else replace(kept, hypothesis=hypothesis)

    def fits_beside(
        self, about: Candidate, effects: Sequence[Effect], sizes: Sequence[float] | None = None
    ) -> list[Candidate]:
        """A fit with each of the effects more, the best first; only the best are refined. sizes: further starts."""
        tasks = []
        for number, effect in enumerate(effects):
            own = Hypothesis((effect,)).starts()
            if sizes is not None and effect.parameters:
                own.append(np.append(sizes[number], own[0][1:]))
            tasks.append((about.hypothesis.with_effect(effect), [np.append(about.theta, start) for start in own]))
        rough = sorted(self._fitted_all(tasks, ROUGH_ITERATIONS), key=attrgetter("statistic"))
        if not rough:
            return []
        limit = rough[0].statistic + max(NEAR_GAIN, ROUGH_SHARE * (about.statistic - rough[0].statistic))
        most = max(ALWAYS_REFINED, sum(one.statistic <= limit for one in rough))
        refined = self._fitted_all([(one.hypothesis, [one.theta]) for one in rough[:most]], MAX_ITERATIONS)
        return sorted([*refined, *rough[most:]], key=attrgetter("price"))

    def _fitted_all(
        self, tasks: Sequence[tuple[Hypothesis, Sequence[Floats]]], max_iterations: int
    ) -> list[Candidate]:
        """Hypotheses, each fitted from its starts, without those that have no solution."""

        def fitted(task: tuple[Hypothesis, Sequence[Floats]]) -> Candidate | None:
            hypothesis, starts = task
            key = hypothesis.ids if max_iterations == MAX_ITERATIONS else (*hypothesis.ids, ROUGH)
            problem, further = self._problem(hypothesis), len(hypothesis.effects) > 1
            search = partial(candidates.minimum_from, problem, hypothesis.ranges(), starts, max_iterations, further)
            return self._remembered(hypothesis, key, search)

        return [one for one in self.map(fitted, tasks) if one is not None]


def _probes(effect: Effect, small: float) -> list[tuple[float, ...]]:
    """Sizes at which an effect is scored; with a name also the starts of a fit, for some show only from there on."""
    if not effect.parameters or is_term(effect):
        lowest, highest = bounds_of(effect)
        return [(step,) for step in (small, -small) if lowest <= step <= highest]
    first, others = effect.parameters[0], effect.parameters[1:]
    little = [step for step in (first.dead_zone, -first.dead_zone) if first.lowest <= step <= first.highest]
    sizes = [*little, *(start for start in first.starts if start != first.off)]
    return list(product(sizes, *(p.starts for p in others)))


def best_of_each(candidates: Sequence[Candidate], by: Callable[[Candidate], float]) -> list[Candidate]:
    """Every combination of effects once, the best candidate first."""
    best: dict[frozenset[str], Candidate] = {}
    for candidate in sorted(candidates, key=by):
        best.setdefault(frozenset(candidate.ids), candidate)
    return list(best.values())


def _has_twins(hypothesis: Hypothesis, minimum: Minimum) -> bool:
    """Whether two effects of one equation are one: with slopes of their first sizes alike, or one at its bound."""
    ends = np.cumsum([len(effect.parameters) for effect in hypothesis.effects])
    places = zip((int(end) for end in ends), hypothesis.effects, strict=True)
    sized = [(end - len(effect.parameters), effect) for end, effect in places if effect.parameters]
    for pair in combinations(sized, 2):
        (first, effect), (second, other) = pair
        if candidates.equation_of(effect) == candidates.equation_of(other):
            information = minimum.at.information
            alike = SAME_COSINE**2 * information[first, first] * information[second, second]
            at_bound = (minimum.theta[place] in bounds_of(one) for place, one in pair)
            if information[first, second] ** 2 > alike or any(at_bound):
                return True
    return False
