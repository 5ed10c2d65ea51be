"""Names the missing effect: from recordings, by a search, to the verdict and all that goes with it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count
from operator import attrgetter

import numpy as np

from observer_rt.engine.estimation.predictor import NoiseLevels
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy, healthy_for_naming
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.identification.discovery.search import results
from observer_rt.identification.discovery.search.adequacy import HeldOutPoints, cells_of, most_explained
from observer_rt.identification.discovery.search.candidates import Candidate
from observer_rt.identification.discovery.search.fits import Fitter, best_of_each
from observer_rt.identification.discovery.search.laws import Guess
from observer_rt.identification.discovery.search.proposals import proposals_of
from observer_rt.identification.discovery.search.search import Search, indistinguishable, representatives
from observer_rt.identification.likelihood.appearance import Signature, healthy_remainder, smallest_visible
from observer_rt.identification.likelihood.bounded_fit import NORMAL_975
from observer_rt.identification.likelihood.likelihood import joint_likelihood
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.open_loop import consequence
from observer_rt.identification.likelihood.signals import Signal, pool_of
from observer_rt.model.effect import Effect
from observer_rt.model.effective import EffectiveModel

MOST_RANKED, MOST_PROPOSED = 10, 4  # candidates and laws listed
MASS_APART = 0.3 * MILLIGRAM  # kg of an injection, from which on laws that explain as much leave it open
MODEL_SHARE = 0.01
"""Standard deviation of a size, as a share, by a fitted model's error: found on seven plants of other equations."""
METHOD = (
    f"share of exp(-X/(2 T)) among all explanations tried that are adequate, X = -2 log L + 10 a number fitted + 50 "
    f"for a law without a name + 50 for every effect after the first, T = {results.TEMPER} for what no model knows "
    f"of noise and line; at most {results.HIGHEST_PROBABILITY}"
)
WITH_A_WRONG_MODEL = 0.8  # at most, when discovery names something on healthy recordings


def name_effects(
    nominal: EffectiveModel,
    recordings: Sequence[Measurement],
    workers: int = 1,
    progress: Callable[[float], None] = lambda _: None,
    baseline: Healthy = NOT_FITTED,
    chosen: Sequence[str] = (),
    guess: Guess = None,
) -> results.Discovery:
    """The missing effects, fitted to all recordings.

    workers: threads; progress takes the share done; baseline: of healthy recordings; chosen: effects to lead if they
    explain as much as the best; guess: law refitted first. Raises `RunError` when the nominal model has no finite
    solution, `UserError` when the chosen effects explain less.
    """
    likelihood = joint_likelihood(recordings, nominal, baseline.shape)
    effects = representatives(not recordings[0].is_free, _stiffens(nominal))
    fits = count(1)

    def advance(_: Candidate) -> None:
        done = next(fits)
        progress(done / (done + len(effects)))  # the number of fits to come is unknown

    if likelihood.judge(nominal) is None:
        raise RunError("the model has no finite solution on these recordings: see `observer-rt check`")
    fitter = Fitter(likelihood, nominal, workers, advance, baseline.appears)
    fitter.measure(effects)
    search = Search(fitter, effects, baseline, guess)
    outcome = search.run()
    if chosen:
        outcome = _led_by(outcome, chosen)
    result = _Verdict(fitter, outcome, baseline, search.held_out).discovery()
    progress(1.0)
    return result


def _led_by(outcome: results.SearchOutcome, chosen: Sequence[str]) -> results.SearchOutcome:
    """The outcome led by the effects chosen. Raises `UserError` when they are not among those tied."""
    tied = _names_left(outcome)
    for candidate in tied:
        if set(candidate.ids) == set(chosen):
            return replace(outcome, winner=candidate)
    left = ", ".join(" + ".join(candidate.ids) for candidate in tied if candidate.ids) or "nothing"
    problem = f"is no answer to these recordings, which leave open: {left}"
    raise UserError(f"--choose {'+'.join(chosen)}", problem, "choose one of these, or leave --choose out")


def healthy_baseline(
    nominal: EffectiveModel,
    recordings: Sequence[Measurement],
    workers: int = 1,
    remembered: Healthy = NOT_FITTED,
    progress: Callable[[float], None] = lambda _: None,
) -> tuple[Healthy, results.Discovery]:
    """The healthy injector by recordings and `remembered`, and discovery on them. Errors as of `name_effects`."""
    likelihood = joint_likelihood(recordings, nominal, remembered.shape)
    judged = likelihood.judge(nominal)
    if judged is None:
        raise RunError("the model has no finite solution on the healthy recordings: see `observer-rt check`")
    discovery = name_effects(nominal, recordings, workers, progress, remembered)
    effects = representatives(not recordings[0].is_free, _stiffens(nominal))
    remainder = healthy_remainder(likelihood, nominal, effects, remembered)
    rate = pool_of(likelihood.recordings, judged).get(Signal.INJECTION_RATE)
    return healthy_for_naming(remainder, discovery.verdict is results.Verdict.NONE, rate), discovery


def _stiffens(nominal: EffectiveModel) -> bool:
    return nominal.injector.fluid.bulk_modulus_by_pressure > 0.0


def _names_left(outcome: results.SearchOutcome) -> tuple[Candidate, ...]:
    """Explanations by name that the recordings leave open, the winner first."""
    named = [one for one in outcome.left if one.ids and not one.terms]
    if not outcome.adequate or not outcome.winner.ids or not named:
        return ()
    return (outcome.winner, *(one for one in named if one.key != outcome.winner.key))


class _Verdict:
    def __init__(
        self, fitter: Fitter, outcome: results.SearchOutcome, baseline: Healthy, held_out: HeldOutPoints
    ) -> None:
        self._fitter, self._outcome, self._baseline, self._held_out = fitter, outcome, baseline, held_out
        self._nominal, self._likelihood = fitter.nominal, fitter.likelihood
        self._measured = [recorded.measurement for recorded in fitter.likelihood.recordings]
        self._names = _names_left(outcome)
        laws = [one for one in outcome.left or outcome.nearest if one.terms]
        self._proposals = proposals_of(laws[:MOST_PROPOSED], fitter, outcome, baseline, held_out)

    def _verdict(self) -> results.Verdict:
        """The answer in a word. Laws that explain as much and inject different masses are ambiguous, too."""
        if self._names:
            is_open = self._names[1:] or self._proposals or self._outcome.soft
            return results.Verdict.AMBIGUOUS if is_open else results.Verdict.NAMED
        if self._outcome.adequate and not self._proposals:
            return results.Verdict.NONE
        masses = [one.candidate.moves.mass for one in self._proposals if one.adequate] or [0.0]
        return results.Verdict.AMBIGUOUS if np.ptp(masses) > MASS_APART else results.Verdict.UNKNOWN

    def _confidence(self, verdict: results.Verdict) -> float:
        """Probability of the verdict: of the name or law that leads, of all laws, or that nothing is missing."""
        outcome, laws = self._outcome, [one.probability for one in self._proposals]
        if self._names or not self._proposals:
            sure = outcome.probability(outcome.winner)
        else:
            sure = sum(laws) if verdict is results.Verdict.UNKNOWN else laws[0]
        if not outcome.posterior:
            sure = results.HIGHEST_PROBABILITY * (1.0 - 0.5 / outcome.ratio)
        return sure if self._baseline.adequate else min(sure, WITH_A_WRONG_MODEL)

    def discovery(self) -> results.Discovery:
        outcome, verdict = self._outcome, self._verdict()
        confidence = self._confidence(verdict)
        by_name = (one for one in outcome.fitted if not one.terms)
        best = outcome.winner if outcome.adequate else min(by_name, key=attrgetter("statistic"))
        recordings = self._likelihood.recordings
        with_rate = any(recorded.rate_phases.size for recorded in recordings)
        after, gain = self._cells(best), outcome.nominal.statistic - outcome.winner.statistic
        left = max(0.0, sum(cell.samples * (cell.variance - 1.0) for cell in after))
        explained = gain / (gain + left) if gain > 0.0 else 0.0
        open_ids = [one for name in self._names for one in name.ids]
        is_open = bool(self._proposals) or not outcome.adequate
        return results.Discovery(
            verdict=verdict,
            named=outcome.winner if self._names else outcome.nominal,
            best=best,
            effects=self._effects(confidence, explained) if self._names else (),
            rivals=tuple(one.ids for one in self._names[1:]),
            ranking=self._ranking(),
            samples=float(sum(each.phases.size + each.rate_phases.size for each in recordings)),
            detection=results.Detection(gain, outcome.threshold),
            confidence=confidence,
            confidence_method=METHOD,
            unexplained=self._unexplained(best) if is_open else None,
            decide_by=(
                *(results.decide_by(open_ids, with_rate) if verdict is results.Verdict.AMBIGUOUS else ()),
                *results.decide_between(self._proposals, with_rate),
            ),
            before=self._cells(outcome.nominal),
            after=after,
            noise=self._noise(),
            smallest_visible=tuple(map(self._smallest_visible, self._fitter.signatures.values())),
        )

    def _noise(self) -> NoiseLevels:
        levels = [(one.noise.rail_pressure, one.noise.line_pressure, one.noise.needle_lift) for one in self._measured]
        return NoiseLevels(*(float(np.sqrt(np.mean([level**2 for level in of]))) for of in zip(*levels, strict=True)))

    def _smallest_visible(self, signature: Signature) -> results.SmallestVisible:
        first, size = signature.effect.parameters[0], smallest_visible(self._baseline.appears, signature)
        return results.SmallestVisible(signature.effect.id, first.name, size / first.si, first.unit)

    def _effects(self, confidence: float, explained: float) -> tuple[results.FittedEffect, ...]:
        winner = self._outcome.winner
        full_model, parameters = winner.model(self._nominal), self._with_intervals(winner).parameters
        gains = list(map(self._gain, winner.hypothesis.effects))
        result = []
        for effect, gain in zip(winner.hypothesis.effects, gains, strict=True):
            remaining, sizes = winner.without(effect)
            rivals = [name.ids for name in self._names[1:] if set(remaining.ids) <= set(name.ids)]
            instead = [one for ids in rivals for one in ids if one not in winner.ids]
            others = tuple(dict.fromkeys((*indistinguishable(effect, _stiffens(self._nominal)), *instead)))
            moves = consequence(self._measured, remaining.model(self._nominal, sizes), full_model)
            share = explained * gain / sum(gains)
            result.append(
                results.FittedEffect(effect.id, parameters[effect.id], confidence, others, share, moves, gain)
            )
        return tuple(result)

    def _gain(self, effect: Effect) -> float:
        others, start = self._outcome.winner.without(effect)
        smaller = [one for one in self._outcome.fitted if set(one.ids) == set(others.ids)]
        if not smaller:  # the search fits only some pairs out of three effects
            smaller = [*self._fitter.laws([(others, start)]), self._outcome.nominal]
        return min(one.statistic for one in smaller) - self._outcome.winner.statistic

    def _with_intervals(self, candidate: Candidate) -> Candidate:
        """Intervals are by noise, the healthy injector's scatter and a fit's exactness."""
        variances = (results.INTERVAL_MARGIN * self._fitter.sigmas(candidate)) ** 2
        if self._baseline.appears:
            variances += (MODEL_SHARE * candidate.theta) ** 2
        hypothesis = candidate.hypothesis
        for effect, own in zip(hypothesis.effects, hypothesis.split(variances), strict=True):
            own[:1] += self._fitter.reference(effect)[1] ** 2  # of its first parameter, within `variances`
        return replace(candidate, half=tuple((NORMAL_975 * np.sqrt(variances)).tolist()))

    def _ranking(self) -> tuple[Candidate, ...]:
        """Leaders by what they cost, the winner, its rivals and the nominal model among them, by -2 log L."""
        outcome = self._outcome
        leaders = best_of_each(outcome.fitted, attrgetter("price"))[:MOST_RANKED]
        shown = (*leaders, outcome.winner, *self._names, *outcome.left, outcome.nominal)
        chosen = {one.key: one for one in shown}.values()
        return tuple(
            replace(
                self._with_intervals(one),
                held_out=self._held_out.statistic(one),
                sizes_of_half=self._held_out.sizes(one),
                moves=consequence(self._measured, self._nominal, one.model(self._nominal)),
            )
            for one in sorted(chosen, key=lambda one: one.statistic)
        )

    def _cells(self, candidate: Candidate) -> tuple[results.Cell, ...]:
        return cells_of(self._likelihood, self._fitter.judged(candidate), candidate.model(self._nominal))

    def _unexplained(self, best: Candidate) -> results.LargestMisfit | None:
        leading = self._proposals[0].candidate if self._proposals else best
        variables = {one.word for term in leading.terms for one in term.law.variables}
        equations = [effect.equation for effect in leading.hypothesis.effects]
        if not equations:
            return None
        where = equations[0], *most_explained(self._fitter.pool(self._outcome.nominal), self._fitter.pool(leading))
        return results.LargestMisfit(*where, tuple(sorted(variables)), " + ".join(leading.ids), self._proposals)
