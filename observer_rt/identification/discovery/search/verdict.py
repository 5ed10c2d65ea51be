"""Names the missing effect: from recordings to the verdict, and to measurements that would decide."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import combinations
from operator import attrgetter

import numpy as np

from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy, healthy_for_naming
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.identification.discovery.search.adequacy import cells_of, worst
from observer_rt.identification.discovery.search.candidates import Candidate, Hypothesis
from observer_rt.identification.discovery.search.fits import Fitter, best_of_each
from observer_rt.identification.discovery.search.held_out import HeldOutPoints
from observer_rt.identification.discovery.search.laws import Guess
from observer_rt.identification.discovery.search.proposal import Proposal
from observer_rt.identification.discovery.search.proposals import proposals_of
from observer_rt.identification.discovery.search.results import (
    HIGHEST,
    INTERVAL_MARGIN,
    TEMPER,
    Cell,
    Decisive,
    Detection,
    Discovery,
    FittedEffect,
    LargestMisfit,
    SearchOutcome,
    SmallestVisible,
    Verdict,
)
from observer_rt.identification.discovery.search.search import Search, indistinguishable, representatives
from observer_rt.identification.likelihood.appearance import Signature, healthy_remainder, smallest_visible
from observer_rt.identification.likelihood.bounded_fit import NORMAL_975
from observer_rt.identification.likelihood.likelihood import Signal, joint_likelihood, pool_of
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.open_loop import consequence
from observer_rt.model.effect import WITH_A_MEASURED_RATE, Component, Effect
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import VOCABULARY

_PRESSURE_SENSORS = frozenset({Component.RAIL_SENSOR, Component.LINE_SENSOR})


_BESIDE_SHUT_NEEDLE = {Component.SEAT, Component.LIFT_SENSOR, Component.CLOSED_END}
"""Places at which fuel may leave, or seem to, while the needle is shut."""
RANKED, MOST_PROPOSED = 10, 4  # candidates and laws listed
MASS_APART = 0.3 * MILLIGRAM  # kg of an injection, from which on laws that explain as much leave it open
MODEL_SHARE = 0.01
"""Standard deviation of a size, as a share: a fitted model answers to an effect no more exactly than to an injection.
Found on seven plants of other equations than the model's, each with a discrepancy of its own."""
Progress = Callable[[float], None]
"""Called with the share done, 0 to 1."""
METHOD = (
    f"share of exp(-X/(2 T)) among all explanations tried that are adequate, X = -2 log L + 10 a number fitted + 50 "
    f"for a law without a name + 50 for every effect after the first, T = {TEMPER} for what no model knows of noise "
    f"and line; at most {HIGHEST}"
)
WITH_A_WRONG_MODEL = 0.8  # at most, when discovery names something on healthy recordings


def decide_by(ids: Iterable[str], rate_measured: bool = False) -> tuple[Decisive, ...]:
    """For every two of the effects, the measurement that would tell them apart.

    rate_measured: the injection rate is among what could not tell them.
    """
    pairs = combinations(dict.fromkeys(ids), 2)
    return _by_measurement(
        (_measurement(VOCABULARY[one], VOCABULARY[other], rate_measured), (one, other)) for one, other in pairs
    )


def decide_between(proposals: Sequence[Proposal], rate_measured: bool = False) -> tuple[Decisive, ...]:
    """The measurements that would tell the first proposal from the others; see `decide_by`."""
    decisions = []
    for number, other in enumerate(proposals[1:], start=2):
        ours, theirs = (first.candidate.hypothesis.effects for first in (proposals[0], other))
        first = next((effect for effect in ours if effect not in theirs), ours[0])
        instead = next((effect for effect in theirs if effect not in ours), theirs[0])
        decisions.append((_measurement(first, instead, rate_measured), ("proposal 1", f"proposal {number}")))
    return _by_measurement(decisions)


def _by_measurement(decisions: Iterable[tuple[str, tuple[str, str]]]) -> tuple[Decisive, ...]:
    """Every measurement once, with all that it tells apart."""
    separated: dict[str, dict[str, None]] = {}
    for measurement, names in decisions:
        separated.setdefault(measurement, {}).update(dict.fromkeys(names))
    return tuple(Decisive(measurement, tuple(names)) for measurement, names in separated.items())


def _measurement(first: Effect, second: Effect, rate_measured: bool) -> str:
    """Finds the measurement that decides, by what the effects state, else by their places."""
    relation, places = first.relation_to(second), {first.component, second.component}
    said = relation.decided_by if relation is not None else first.decided_by or second.decided_by
    if said:
        return WITH_A_MEASURED_RATE.get(said, said) if rate_measured else said
    if places <= _BESIDE_SHUT_NEEDLE and len(places) > 1 and not rate_measured:
        return "the injection rate or mass measured, or a recording with the needle shut for a second"
    if places & _PRESSURE_SENSORS:
        return "the pressure sensors against a reference gauge, and recordings at more rail pressures"
    at_chamber = Component.CHAMBER in places or Component.NOZZLE in places
    more = "rail pressures and at another chamber pressure" if at_chamber else "rail pressures and durations"
    with_rate = "" if rate_measured else ", with the injection rate measured"
    return f"recordings at more {more}{with_rate}"


def name_effects(
    nominal: EffectiveModel,
    recordings: Sequence[Measurement],
    workers: int = 1,
    progress: Progress | None = None,
    baseline: Healthy = NOT_FITTED,
    chosen: Sequence[str] = (),
    guess: Guess = None,
) -> Discovery:
    """The missing effects, fitted to all recordings.

    workers: threads; baseline: of healthy recordings; chosen: effects that are to lead where they are among those
    that explain the recordings as well as the best; guess: learned law that is refitted first.

    Raises `RunError` when the nominal model has no finite solution on them, `UserError` when the chosen effects are
    no answer to them.
    """
    likelihood = joint_likelihood(recordings, nominal, baseline.shape)
    effects = representatives(not recordings[0].is_free)
    done = 0

    def count(_: Candidate) -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done / (done + len(effects)))  # how many there will be nobody knows

    if likelihood.judge(nominal) is None:
        raise RunError("the model has no finite solution on these recordings: see `observer-rt check`")
    fitter = Fitter(likelihood, nominal, workers, count, baseline.appears)
    fitter.measure(effects)
    search = Search(fitter, effects, baseline, guess)
    outcome = search.run()
    if chosen:
        outcome = _led_by(outcome, chosen)
    result = _Verdict(fitter, outcome, baseline, search.held_out).discovery()
    if progress is not None:
        progress(1.0)
    return result


def _led_by(outcome: SearchOutcome, chosen: Sequence[str]) -> SearchOutcome:
    """The outcome led by what the user chose. Raises `UserError` when the recordings do not leave it open."""
    tied = _names_left(outcome)
    for candidate in tied:
        if set(candidate.ids) == set(chosen):
            return replace(outcome, winner=candidate)
    left = ", ".join(" + ".join(candidate.ids) for candidate in tied if candidate.ids) or "nothing"
    raise UserError(
        f"--choose {'+'.join(chosen)}",
        f"is no answer to these recordings, which leave open: {left}",
        "choose one of these, or leave --choose out",
    )


def healthy_baseline(
    nominal: EffectiveModel,
    recordings: Sequence[Measurement],
    workers: int = 1,
    remembered: Healthy = NOT_FITTED,
    progress: Progress | None = None,
) -> tuple[Healthy, Discovery]:
    """Measures what healthy recordings leave unexplained; discovery finds `none` in them for an adequate model.

    remembered: what the model's own fit remembers of the healthy injector.
    """
    likelihood = joint_likelihood(recordings, nominal, remembered.shape)
    judged = likelihood.judge(nominal)
    if judged is None:
        raise RunError("the model has no finite solution on the healthy recordings: see `observer-rt check`")
    discovery = name_effects(nominal, recordings, workers, progress, remembered)
    remainder = healthy_remainder(likelihood, nominal, representatives(not recordings[0].is_free), remembered)
    rate = pool_of(likelihood.recordings, judged).get(Signal.INJECTION_RATE)
    return healthy_for_naming(remainder, discovery.verdict is Verdict.NONE, rate), discovery


def _names_left(outcome: SearchOutcome) -> tuple[Candidate, ...]:
    """What the recordings leave open that has a name, the winner first; nothing where they leave laws only."""
    named = [one for one in outcome.left if one.ids and not one.terms]
    if not outcome.adequate or not outcome.winner.ids or not named:
        return ()
    return (outcome.winner, *(one for one in named if one.key != outcome.winner.key))


class _Verdict:
    """The result of a search in the words of a `Discovery`."""

    def __init__(self, fitter: Fitter, outcome: SearchOutcome, baseline: Healthy, held_out: HeldOutPoints) -> None:
        self._fitter = fitter
        self._held_out = held_out
        self._nominal = fitter.nominal
        self._likelihood = fitter.likelihood
        self._measured = [recorded.measurement for recorded in fitter.likelihood.recordings]
        self._outcome = outcome
        self._baseline = baseline
        self._names = _names_left(outcome)
        laws = [one for one in outcome.left or outcome.nearest if one.terms]
        self._proposals = proposals_of(laws[:MOST_PROPOSED], fitter, outcome, baseline, held_out)

    def _verdict(self) -> Verdict:
        """Laws that explain as much and inject other masses leave it open, too."""
        if self._names:
            is_open = self._names[1:] or self._proposals or self._outcome.soft
            return Verdict.AMBIGUOUS if is_open else Verdict.NAMED
        if self._outcome.adequate and not self._proposals:
            return Verdict.NONE
        masses = [one.candidate.moves.mass for one in self._proposals if one.adequate] or [0.0]
        return Verdict.AMBIGUOUS if np.ptp(masses) > MASS_APART else Verdict.UNKNOWN

    def _confidence(self, verdict: Verdict) -> float:
        """Probability of the verdict: of the name or law that leads, of all laws, or that nothing is missing."""
        outcome, laws = self._outcome, [one.probability for one in self._proposals]
        if self._names or not self._proposals:
            sure = outcome.probability(outcome.winner)
        else:
            sure = sum(laws) if verdict is Verdict.UNKNOWN else laws[0]
        if not outcome.posterior:
            sure = HIGHEST * (1.0 - 0.5 / outcome.ratio)
        return sure if self._baseline.adequate else min(sure, WITH_A_WRONG_MODEL)

    def discovery(self) -> Discovery:
        """Everything together."""
        outcome, verdict = self._outcome, self._verdict()
        confidence = self._confidence(verdict)
        by_name = (one for one in outcome.fitted if not one.terms)
        best = outcome.winner if outcome.adequate else min(by_name, key=attrgetter("statistic"))
        recordings = self._likelihood.recordings
        noise = [one.noise for one in self._measured]
        with_rate = any(recorded.rate_phases.size for recorded in recordings)
        after, gain = self._cells(best), outcome.nominal.statistic - outcome.winner.statistic
        left = max(0.0, sum(cell.samples * (cell.variance - 1.0) for cell in after))
        explained = gain / (gain + left) if gain > 0.0 else 0.0
        open_ids = [one for name in self._names for one in name.ids]
        is_open = bool(self._proposals) or not outcome.adequate
        return Discovery(
            verdict=verdict,
            named=outcome.winner if self._names else outcome.nominal,
            best=best,
            effects=self._effects(confidence, explained) if self._names else (),
            rivals=tuple(one.ids for one in self._names[1:]),
            ranking=self._ranking(),
            samples=float(sum(each.phases.size + each.rate_phases.size for each in recordings)),
            detection=Detection(gain, outcome.threshold),
            confidence=confidence,
            confidence_method=METHOD,
            unexplained=self._unexplained(best) if is_open else None,
            decide_by=(
                *(decide_by(open_ids, with_rate) if verdict is Verdict.AMBIGUOUS else ()),
                *decide_between(self._proposals, with_rate),
            ),
            before=self._cells(outcome.nominal),
            after=after,
            noise=NoiseLevels(
                *(
                    float(np.sqrt(np.mean([getattr(level, name) ** 2 for level in noise])))
                    for name in ("rail_pressure", "line_pressure", "needle_lift")
                )
            ),
            smallest_visible=tuple(map(self._smallest_visible, self._fitter.signatures.values())),
        )

    def _smallest_visible(self, signature: Signature) -> SmallestVisible:
        first, size = signature.effect.parameters[0], smallest_visible(self._baseline.appears, signature)
        return SmallestVisible(signature.effect.id, first.name, size / first.si, first.unit)

    def _effects(self, confidence: float, explained: float) -> tuple[FittedEffect, ...]:
        """The winner's effects. explained: share of the disagreement."""
        winner = self._outcome.winner
        full_model, parameters = winner.model(self._nominal), self._with_intervals(winner).parameters
        gains = [self._gain(number) for number in range(len(winner.ids))]
        result = []
        for number, (effect, gain) in enumerate(zip(winner.hypothesis.effects, gains, strict=True)):
            instead = [
                one
                for name in self._names[1:]
                if set(winner.ids) - {effect.id} <= set(name.ids)
                for one in name.ids
                if one not in winner.ids
            ]
            others = tuple(dict.fromkeys((*indistinguishable(effect), *instead)))
            moves = consequence(self._measured, winner.model_without(number, self._nominal), full_model)
            share = explained * gain / sum(gains)
            result.append(FittedEffect(effect.id, parameters[effect.id], confidence, others, share, moves, gain))
        return tuple(result)

    def _gain(self, number: int) -> float:
        """Rise of -2 log L without one of the winner's effects."""
        winner = self._outcome.winner
        left = [part for place, part in enumerate(winner.parts) if place != number]
        others = Hypothesis(tuple(effect for effect, _, _ in left))
        smaller = [one for one in self._outcome.fitted if set(one.ids) == set(others.ids)]
        if not smaller:  # of two out of three nobody fitted what the search did not ask for
            start = np.concatenate([sizes for _, sizes, _ in left])
            smaller = [*self._fitter.laws([(others, start)]), self._outcome.nominal]
        return min(one.statistic for one in smaller) - winner.statistic

    def _with_intervals(self, candidate: Candidate) -> Candidate:
        """A candidate with the intervals of its sizes: by the information at the minimum, by how much the effect
        appears to be now more, now less, on the healthy injector, and by how exact a fitted model is."""
        variances = (INTERVAL_MARGIN * self._fitter.sigmas(candidate)) ** 2
        if self._baseline.appears:
            variances += (MODEL_SHARE * candidate.theta) ** 2
        position = 0
        for effect, sizes, _ in candidate.parts:
            if sizes.size:
                variances[position] += self._fitter.reference(effect)[1] ** 2
            position += sizes.size
        return replace(candidate, half=tuple((NORMAL_975 * np.sqrt(variances)).tolist()))

    def _ranking(self) -> tuple[Candidate, ...]:
        """Leaders by what they cost, the winner, its rivals and the nominal model among them, by -2 log L."""
        outcome = self._outcome
        leaders = best_of_each(outcome.fitted, attrgetter("price"))[:RANKED]
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

    def _cells(self, candidate: Candidate) -> tuple[Cell, ...]:
        judged = self._fitter.judged(candidate)
        return () if judged is None else cells_of(self._likelihood, judged, candidate.model(self._nominal))

    def _unexplained(self, best: Candidate) -> LargestMisfit | None:
        """Where the model as given fails most, and the equation and variables of what explains most of it."""
        pool = self._fitter.pool(self._outcome.nominal)
        assert pool is not None  # the search began with it
        worst_cell = worst(pool, self._baseline)
        leading = self._proposals[0].candidate if self._proposals else best
        variables = {one.word for term in leading.terms for one in term.law.variables}
        equations = [effect.equation for effect in leading.hypothesis.effects]
        if not equations:
            return None
        return LargestMisfit(
            equations[0],
            worst_cell.phase,
            worst_cell.signal,
            tuple(sorted(variables)),
            " + ".join(leading.ids),
            self._proposals,
        )
