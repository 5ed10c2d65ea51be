"""Fits of explanations: each made once, several at a time, and what any further effect would gain beside them."""

import math
from collections.abc import Callable, Mapping, MutableMapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import combinations, product
from operator import attrgetter, itemgetter
from types import MappingProxyType
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from observer_rt.identification.discovery.search.hypothesis import (
    Hypothesis,
    Sizing,
    equation_of,
    minimum_from,
)
from observer_rt.identification.discovery.search.results import Candidate
from observer_rt.identification.discovery.search.scores import Scores, Signature, scored, weights_of
from observer_rt.identification.likelihood import appearance
from observer_rt.identification.likelihood.bounded_fit import (
    MAX_ITERATIONS,
    Minimum,
    Residuals,
    fit,
    linearise,
    sigmas_of,
)
from observer_rt.identification.likelihood.likelihood import (
    JointLikelihood,
    JudgedModel,
    Pool,
    pool_of,
    residuals_of,
)
from observer_rt.model.baseline import Appearance
from observer_rt.model.effect import Effect
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.term_effect import form_freed, form_settled, is_term
from observer_rt.model.terms.term import TermEquation

WORTH_FITTING = 10.0  # predicted gain from which on a second effect is fitted
PROMISED = 0.5  # of a gain that is needed: a promise is linear, and not exact
MOST_SECONDS = 6  # second effects fitted to one leader
ROUGH_ITERATIONS = 3  # of the first fit of every effect
ROUGH_SHARE = 0.5  # of what the best single explains: those that leave more of it unexplained stay rough
ALWAYS_REFINED = 4  # leaders
LAW_ITERATIONS, FREED_ITERATIONS = 6, 8  # of a fit of laws, and with the numbers within them free
SAME = 0.998  # cosine of two signatures of one equation, from which on they stand for one
NEAR = 40.0  # of -2 log L beyond which a candidate takes nothing from the confidence in another

KEPT = 24  # candidates whose residuals are kept

ROUGH, FREED = "rough", "freed"

_TINY = 1e-30
_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

_Key = tuple[tuple[str, ...], tuple[float, ...]]
Fit = tuple[NDArray[np.float64], float, float]
"""theta (p,), -2 log L and the mean square of the residuals."""
FitMemory = MutableMapping[tuple[str, ...], Fit]
"""Fitted candidates by the ids of their effects, and ROUGH or FREED after them: an interrupted run goes on where it
was."""


class Fitter:
    """Fits hypotheses to the likelihood on several threads (the compiled prediction runs without the lock)."""

    def __init__(
        self,
        likelihood: JointLikelihood,
        nominal: EffectiveModel,
        workers: int = 1,
        memory: FitMemory | None = None,
        fitted: Callable[[Candidate], None] | None = None,
        appears: Mapping[str, Appearance] = MappingProxyType({}),
    ) -> None:
        """fitted: called with every fit as soon as it is there; appears: what the healthy injector
        appears to have."""
        self.likelihood = likelihood
        self.nominal = nominal
        self._workers = workers
        self._memory: FitMemory = {} if memory is None else memory
        self._fitted = fitted
        self._appears = appears
        self._signatures: dict[str, appearance.Signature] = {}
        self._sigmas: dict[_Key, NDArray[np.float64]] = {}
        self._judged: dict[_Key, list[JudgedModel] | None] = {}
        self._pools: dict[_Key, Pool | None] = {}
        self._failed: set[tuple[str, ...]] = set()

    def nothing(self) -> Candidate:
        """The nominal model."""
        residuals = self.likelihood.residuals(self.nominal)
        assert residuals is not None  # the search began with it
        return Candidate(Hypothesis(), (), residuals.statistic, residuals.spread)

    def measure(self, effects: Sequence[Effect]) -> None:
        """Measures how a small size of every effect moves the residuals of the nominal model."""
        judged = self.judged(self.nothing())
        assert judged is not None  # the search began with it
        signatures = self.map(
            lambda effect: appearance.signatures(self.likelihood, self.nominal, judged, [effect]), effects
        )
        self._signatures = {one.effect.id: one for each in signatures for one in each}

    @property
    def signatures(self) -> Sequence[appearance.Signature]:
        """Signatures of the effects measured."""
        return tuple(self._signatures.values())

    def reference(self, effect: Effect) -> tuple[float, float]:
        """The size an effect appears to have on the healthy injector, as these recordings see it."""
        signature = self._signatures.get(effect.id)
        return (0.0, 0.0) if signature is None else appearance.reference(self._appears, signature)

    def smallest_visible(self, signature: appearance.Signature) -> float:
        """Size [SI] from which on an effect is distinguished from noise and from the healthy injector."""
        return appearance.smallest_visible(self._appears, signature)

    def judged(self, candidate: Candidate) -> list[JudgedModel] | None:
        """A candidate on every recording; None without a solution."""
        runs = self._judged.get(candidate.key)
        if runs is None and candidate.key not in self._judged:
            runs = self._judged[candidate.key] = self.likelihood.judge(candidate.model(self.nominal))
            for old in list(self._judged)[:-KEPT]:
                self._judged.pop(old, None)
        return runs

    def pool(self, candidate: Candidate) -> Pool | None:
        """What a candidate leaves by signal and phase; None without a solution."""
        if candidate.key not in self._pools:
            judged = self.judged(candidate)
            self._pools[candidate.key] = None if judged is None else pool_of(self.likelihood, judged)
        return self._pools[candidate.key]

    def residuals(self, candidate: Candidate) -> Residuals | None:
        """What a candidate leaves; None without a solution."""
        judged = self.judged(candidate)
        return None if judged is None else residuals_of(judged)

    def sigmas(self, candidate: Candidate) -> NDArray[np.float64]:
        """Standard deviations of a candidate's sizes by noise, from the information there; inf where it has none."""
        if candidate.key not in self._sigmas:
            residuals = self.residuals(candidate)
            if residuals is None or not candidate.hypothesis.effects:
                return np.full(len(candidate.sizes), np.inf)
            information = linearise(
                self._sizing(candidate.hypothesis), candidate.theta, residuals, candidate.hypothesis.ranges()
            ).information
            spread = np.sqrt(max(1.0, float(np.mean(residuals.z**2))))
            self._sigmas[candidate.key] = sigmas_of(information) * spread
        return self._sigmas[candidate.key]

    def _sizing(self, hypothesis: Hypothesis) -> Sizing:
        return Sizing(self.likelihood, self.nominal, hypothesis)

    def map(self, work: Callable[[_Item], _Result], items: Sequence[_Item]) -> list[_Result]:
        """Results of `work` in the order of the items; an interruption does not wait for those not begun."""
        with ThreadPoolExecutor(self._workers) as pool:
            try:
                return list(pool.map(work, items))
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise

    def scores(self, about: Candidate, effects: Sequence[Effect]) -> Scores:
        """Scores of effects with one size that a candidate does not have, a small one of each beside it."""
        here = self.residuals(about)
        assert here is not None  # it was fitted
        weights = weights_of(here)
        left = np.asarray(weights * here.z, np.float32)

        def signature(effect: Effect) -> Signature | None:
            size, hypothesis = effect.parameters[0], about.hypothesis.with_effect(effect)
            small = hypothesis.ranges()[-1].step if is_term(effect) else 0.5 * size.dead_zone
            scored_effects: list[tuple[float, Signature]] = []
            for step in (small, -small):
                if size.lowest <= step <= size.highest:
                    moved = self._sizing(hypothesis).residuals(np.append(about.theta, step))
                    if moved is not None:
                        slope = np.asarray(weights * (here.z - moved.z) / step, np.float32)
                        gain = max(float(slope @ left) * math.copysign(1.0, step), 0.0) ** 2
                        scored_effects.append((gain / max(float(slope @ slope), _TINY), slope))
                if scored_effects and equation_of(effect) != TermEquation.NEEDLE_LIFT:
                    break  # but a needle is shut or open: little more is not little less the other way round
            return max(scored_effects, key=itemgetter(0))[1] if scored_effects else None

        scored_effects = [
            (number, one)
            for number, one in enumerate(self.map(signature, effects))
            if one is not None and one.any()
        ]
        numbers = np.array([number for number, _ in scored_effects], np.int64)
        slopes = (
            np.column_stack([one for _, one in scored_effects])
            if scored_effects
            else np.zeros((here.z.size, 0), np.float32)
        )
        return scored([effects[number] for number in numbers], numbers, slopes, here)

    def laws(self, hypotheses: Sequence[tuple[Hypothesis, NDArray[np.float64]]]) -> list[Candidate]:
        """Fits of laws, perhaps beside effects of one size, each from where it is said; those there are."""
        return [one for one in self.map(lambda item: self._law(*item), hypotheses) if one is not None]

    def _law(self, hypothesis: Hypothesis, start: NDArray[np.float64]) -> Candidate | None:
        def minimum_of_law() -> Minimum | None:
            sizing, ranges = self._sizing(hypothesis), hypothesis.ranges()
            for share in (1.0, 0.3):  # of what was scored, should the model have no solution there
                minimum = fit(sizing, share * start, ranges, LAW_ITERATIONS)
                if minimum is not None:
                    return None if _has_twins(hypothesis, minimum) else minimum
            return None

        return self._remembered(hypothesis, hypothesis.ids, minimum_of_law)

    def sharpened(self, candidate: Candidate) -> Candidate | None:
        """A candidate with the numbers within its laws fitted, too; None where they have none."""
        effects = candidate.hypothesis.effects
        freed = Hypothesis(tuple(map(form_freed, effects)))
        if len(freed.parameters) == len(candidate.sizes):
            return None
        parts = zip(freed.effects, candidate.hypothesis.split(candidate.theta), strict=True)
        start = [
            np.append(sizes, [p.starts[0] for p in effect.parameters[sizes.size :]])
            for effect, sizes in parts
        ]
        fit_of_form = self._remembered(
            freed,
            (*candidate.ids, FREED),
            lambda: fit(self._sizing(freed), np.concatenate(start), freed.ranges(), FREED_ITERATIONS),
        )
        if fit_of_form is None:
            return None
        settled = tuple(
            form_settled(effect, values[1:].tolist()) if is_term(effect) else effect
            for effect, values in zip(effects, freed.split(fit_of_form.theta), strict=True)
        )
        return self._law(Hypothesis(settled), candidate.theta)

    def _remembered(
        self, hypothesis: Hypothesis, key: tuple[str, ...], search: Callable[[], Minimum | None]
    ) -> Candidate | None:
        """A fit made before, else made now and kept."""
        stored = self._memory.get(key)
        if stored is not None:
            return Candidate(hypothesis, tuple(stored[0].tolist()), *stored[1:])
        minimum = None if key in self._failed else search()
        if minimum is None:
            self._failed.add(key)
            return None
        spread = minimum.residuals.spread
        candidate = Candidate(hypothesis, tuple(minimum.theta.tolist()), minimum.statistic, spread)
        self._memory[key] = minimum.theta, minimum.statistic, spread
        if self._fitted is not None:
            self._fitted(candidate)
        return candidate

    def _fit_all(self, tasks: Sequence["_Task"], max_iterations: int) -> list[Candidate]:
        """Fit hypotheses, each from its starts; those without a solution are left out."""

        def fitted(task: _Task) -> Candidate | None:
            hypothesis = task.hypothesis
            key = hypothesis.ids if max_iterations == MAX_ITERATIONS else (*hypothesis.ids, ROUGH)
            return self._remembered(
                hypothesis,
                key,
                lambda: minimum_from(self._sizing(hypothesis), task.starts, max_iterations, task.probed),
            )

        return [one for one in self.map(fitted, tasks) if one is not None]

    def singles(self, effects: Sequence[Effect], nominal: Candidate) -> list[Candidate]:
        """Every effect alone; those that explain far less than the best are fitted roughly."""
        hypotheses = [Hypothesis((effect,)) for effect in effects]
        return self._refined([_Task(h, h.starts()) for h in hypotheses], nominal)

    def pairs(self, leaders: Sequence[Candidate], effects: Sequence[Effect], goal: float) -> list[Candidate]:
        """Each leader with the second effects that promise something, fitted together as the singles are.

        goal: price that a pair must come near.
        """
        tasks = [task for leader in leaders for task in self._seconds(leader, effects, goal)]
        return self._refined(tasks, min(leaders, key=attrgetter("statistic")))

    def _refined(self, tasks: Sequence["_Task"], before: Candidate) -> list[Candidate]:
        """Each hypothesis once, best first where it matters: those within reach of the best are fitted to the end.

        before: the best candidate that is smaller.
        """
        rough = best_of_each(self._fit_all(tasks, ROUGH_ITERATIONS), attrgetter("statistic"))
        if not rough:
            return []
        limit = rough[0].statistic + max(NEAR, ROUGH_SHARE * (before.statistic - rough[0].statistic))
        leaders = sum(number < ALWAYS_REFINED or one.statistic <= limit for number, one in enumerate(rough))
        refined = self._fit_all(
            [_Task(one.hypothesis, [one.theta]) for one in rough[:leaders]], MAX_ITERATIONS
        )
        return refined + rough[leaders:]

    def _seconds(self, leader: Candidate, effects: Sequence[Effect], goal: float) -> list["_Task"]:
        """The leader with each second effect that promises something, and where to begin."""
        base = self.residuals(leader)
        if base is None:
            return []
        sizing = self._sizing(leader.hypothesis)
        spanned, _ = np.linalg.qr(linearise(sizing, leader.theta, base, leader.hypothesis.ranges()).slopes)
        others = [effect for effect in effects if effect not in leader.hypothesis.effects]
        promises = self.map(lambda effect: self._promise(leader, base, spanned, effect), others)
        ranked = sorted(zip(promises, others, strict=True), key=lambda item: -item[0].gain)
        least = max(WORTH_FITTING, PROMISED * (leader.price - goal))
        worthwhile = [item for item in ranked if item[0].gain > least][:MOST_SECONDS]
        return [
            _Task(leader.hypothesis.with_effect(effect), promise.starts, probed=True)
            for promise, effect in worthwhile
        ]

    def _promise(
        self, leader: Candidate, base: Residuals, spanned: NDArray[np.float64], effect: Effect
    ) -> "_Promise":
        """Estimates the gain of a second effect were the residuals linear in it, the leader's sizes free."""
        both = leader.hypothesis.with_effect(effect)
        sizing = self._sizing(both)
        best = _Promise(0.0, ())
        for values in _probes(effect):
            start = np.concatenate([leader.theta, values])
            moved = sizing.residuals(start)
            if moved is None:
                continue
            gain = base.statistic - moved.statistic
            if effect.parameters:
                gain = max(gain, _predicted_gain(base, moved, spanned))
            if gain > best.gain:
                off = np.array([p.off for p in effect.parameters])
                best = _Promise(gain, (start, np.concatenate([leader.theta, off + 0.1 * (values - off)])))
        return best


def best_of_each(candidates: Sequence[Candidate], by: Callable[[Candidate], float]) -> list[Candidate]:
    """The best first, each combination of effects once, in whichever order."""
    best: dict[frozenset[str], Candidate] = {}
    for candidate in sorted(candidates, key=by):
        best.setdefault(frozenset(candidate.ids), candidate)
    return list(best.values())


@dataclass(frozen=True, eq=False)
class _Task:
    """A hypothesis to be fitted, and where to begin: at guesses, or at what probing found."""

    hypothesis: Hypothesis
    starts: Sequence[NDArray[np.float64]]
    probed: bool = False


@dataclass(frozen=True, eq=False)
class _Promise:
    gain: float
    starts: tuple[NDArray[np.float64], ...]


def _probes(effect: Effect) -> list[NDArray[np.float64]]:
    """Sizes at which a second effect is tried: small ones of either sign, and the starts that are not off."""
    if not effect.parameters:
        return [np.zeros(0)]
    first, others = effect.parameters[0], effect.parameters[1:]
    sizes = [first.off + sign * 3.0 * first.dead_zone for sign in (1.0, -1.0)]
    sizes += [start for start in first.starts if start != first.off]
    allowed = [size for size in sizes if first.lowest <= size <= first.highest]
    return [np.array(values) for values in product(allowed, *(p.starts for p in others))]


def _predicted_gain(base: Residuals, moved: Residuals, spanned: NDArray[np.float64]) -> float:
    """Least-squares gain along the secant to `moved`, what the leader's own sizes span (n, p) taken out."""
    direction = moved.z - base.z
    direction -= spanned @ (spanned.T @ direction)
    length = float(direction @ direction)
    return float(direction @ base.z) ** 2 / length if length > 0.0 else 0.0


def _has_twins(hypothesis: Hypothesis, minimum: Minimum) -> bool:
    """Whether two effects of one equation stand for one: alike, or with a size at its bound."""
    effects, theta = hypothesis.effects, minimum.theta
    information = minimum.at.information if len(effects) > 1 else np.zeros((1, 1))
    bounds = [(effect.parameters[0].lowest, effect.parameters[0].highest) for effect in effects]
    return any(
        equation_of(effects[one]) == equation_of(effects[other])
        and (
            information[one, other] ** 2 > SAME**2 * information[one, one] * information[other, other]
            or any(theta[i] in bounds[i] for i in (one, other))
        )
        for one, other in combinations(range(len(effects)), 2)
    )
