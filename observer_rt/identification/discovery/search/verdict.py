"""Names the missing effect: from recordings to the verdict, and to measurements that would decide."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy, healthy_for_naming
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.identification.discovery.search.adequacy import cells_of, unexplained, worst
from observer_rt.identification.discovery.search.candidates import FitMemory, Fitter
from observer_rt.identification.discovery.search.proposals import propose
from observer_rt.identification.discovery.search.results import (
    INTERVAL_MARGIN,
    Candidate,
    Cell,
    Consequence,
    Decisive,
    Detection,
    Discovery,
    FittedEffect,
    Proposal,
    SmallestVisible,
    Unexplained,
    Verdict,
)
from observer_rt.identification.discovery.search.search import (
    HeldOutPoints,
    Search,
    SearchOutcome,
    indistinguishable,
    price,
    representatives,
)
from observer_rt.identification.likelihood.appearance import Signature, healthy_remainder
from observer_rt.identification.likelihood.bounded_fit import NORMAL_975
from observer_rt.identification.likelihood.likelihood import Signal, joint_likelihood, pool_of
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.open_loop import mass, simulated
from observer_rt.model.effect import WITH_A_MEASURED_RATE, Effect, Place
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import VOCABULARY

_PRESSURE_SENSORS = frozenset({Place.RAIL_SENSOR, Place.LINE_SENSOR})


_BESIDE_SHUT_NEEDLE = {Place.SEAT, Place.LIFT_SENSOR, Place.CLOSED_END}
"""Places at which fuel may leave, or seem to, while the needle is shut."""
RANKED = 8  # candidates listed
MODEL_SHARE = 0.01
"""Standard deviation of a size, as a share: a fitted model answers to an effect no more exactly than to an injection.
Found on seven plants of other equations than the model's, each with a discrepancy of its own."""
_EXPECTED_MORE = 10  # fits of a usual search after the first of every effect, for the progress shown
Progress = Callable[[float], None]
"""Called with the share done, 0 to 1."""
METHOD = (
    "share of exp(-X/(2 T)) among candidates of the same size that might be right, X = -2 log L + 10 a parameter, "
    "T = 2 for what no model knows of noise and line; at most 0.99"
)
TEMPER = 2.0
HIGHEST = 0.99
WITH_A_WRONG_MODEL = 0.8  # at most, when discovery names something on healthy recordings


def decide_by(ids: Iterable[str], rate_measured: bool = False) -> tuple[Decisive, ...]:
    """For every two of the effects, the measurement that would tell them apart.

    rate_measured: the injection rate is among what could not tell them.
    """
    pairs = combinations(dict.fromkeys(ids), 2)
    return _by_measurement(
        (_measurement(VOCABULARY[one], VOCABULARY[other], rate_measured), (one, other))
        for one, other in pairs
    )


def decide_between(proposals: Sequence[Proposal], rate_measured: bool = False) -> tuple[Decisive, ...]:
    """The measurements that would tell the first proposal from the others; see `decide_by`."""
    found = []
    for number, other in enumerate(proposals[1:], start=2):
        ours, theirs = (one.found.hypothesis.effects for one in (proposals[0], other))
        one = next((effect for effect in ours if effect not in theirs), ours[0])
        instead = next((effect for effect in theirs if effect not in ours), theirs[0])
        found.append((_measurement(one, instead, rate_measured), ("proposal 1", f"proposal {number}")))
    return _by_measurement(found)


def _by_measurement(found: Iterable[tuple[str, tuple[str, str]]]) -> tuple[Decisive, ...]:
    """Every measurement once, with all that it tells apart."""
    separated: dict[str, dict[str, None]] = {}
    for measurement, names in found:
        separated.setdefault(measurement, {}).update(dict.fromkeys(names))
    return tuple(Decisive(measurement, tuple(names)) for measurement, names in separated.items())


def _measurement(one: Effect, other: Effect, rate_measured: bool) -> str:
    """Finds the measurement that decides, by what the effects state, else by their places."""
    relation, places = one.relation_to(other), {one.place, other.place}
    said = relation.decided_by if relation is not None else one.decided_by or other.decided_by
    if said:
        return WITH_A_MEASURED_RATE.get(said, said) if rate_measured else said
    if places <= _BESIDE_SHUT_NEEDLE and len(places) > 1 and not rate_measured:
        return "the injection rate or mass measured, or a recording with the needle shut for a second"
    if places & _PRESSURE_SENSORS:
        return "the pressure sensors against a reference gauge, and recordings at more rail pressures"
    at_chamber = Place.CHAMBER in places or Place.NOZZLE in places
    more = "rail pressures and at another chamber pressure" if at_chamber else "rail pressures and durations"
    with_rate = "" if rate_measured else ", with the injection rate measured"
    return f"recordings at more {more}{with_rate}"


@dataclass(frozen=True)
class SearchOptions:
    """Options of a search. workers: threads; memory: of candidates fitted before; baseline: of healthy recordings;
    chosen: effects that are to lead where they are among those that explain the recordings as well as the best.
    """

    workers: int = 1
    memory: FitMemory | None = None
    progress: Progress | None = None
    baseline: Healthy = NOT_FITTED
    chosen: tuple[str, ...] = ()


def name_effects(
    nominal: EffectiveModel, found: Sequence[Measurement], options: SearchOptions | None = None
) -> Discovery:
    """The missing effects, fitted to all recordings.

    Raises `RunError` when the nominal model has no finite solution on them, `UserError` when what is chosen is no
    answer to them.
    """
    options = options or SearchOptions()
    likelihood = joint_likelihood(found, nominal, options.baseline.shape)
    effects = representatives()
    done = 0

    def count(_: Candidate) -> None:
        nonlocal done
        done += 1
        if options.progress is not None:
            options.progress(min(1.0, done / (len(effects) + _EXPECTED_MORE)))

    if likelihood.judge(nominal) is None:
        raise RunError("the model has no finite solution on these recordings: see `observer-rt check`")
    fitter = Fitter(likelihood, nominal, options.workers, options.memory, count, options.baseline.appears)
    fitter.measure(effects)
    search = Search(fitter, effects, options.baseline)
    outcome = search.run()
    if options.chosen:
        outcome = _led_by(outcome, options.chosen)
    result = _Verdict(fitter, outcome, options.baseline, search.held_out).discovery()
    if options.progress is not None:
        options.progress(1.0)
    return result


def _led_by(found: SearchOutcome, chosen: Sequence[str]) -> SearchOutcome:
    """The outcome led by what the user chose. Raises `UserError` when the recordings do not leave it open."""
    tied = (found.winner, *found.rivals) if found.adequate else ()
    for one in tied:
        if set(one.ids) == set(chosen):
            return replace(found, winner=one, rivals=tuple(other for other in tied if other is not one))
    left = ", ".join(" + ".join(one.ids) for one in tied if one.ids) or "nothing"
    raise UserError(
        f"--choose {'+'.join(chosen)}",
        f"is no answer to these recordings, which leave open: {left}",
        "choose one of these, or leave --choose out",
    )


def healthy_baseline(
    nominal: EffectiveModel,
    found: Sequence[Measurement],
    workers: int = 1,
    known: Healthy = NOT_FITTED,
) -> tuple[Healthy, Discovery]:
    """Measures what healthy recordings leave unexplained; discovery finds `none` in them for an adequate model.

    known: what the model's own fit remembers of the healthy injector.
    """
    likelihood = joint_likelihood(found, nominal, known.shape)
    judged = likelihood.judge(nominal)
    if judged is None:
        raise RunError("the model has no finite solution on the healthy recordings: see `observer-rt check`")
    discovery = name_effects(nominal, found, SearchOptions(workers, baseline=known))
    remainder = healthy_remainder(likelihood, nominal, representatives(), known)
    rate = pool_of(likelihood, judged).get(Signal.INJECTION_RATE)
    return healthy_for_naming(remainder, discovery.verdict is Verdict.NONE, rate), discovery


class _Verdict:
    """The result of a search in the words of a `Discovery`."""

    def __init__(
        self, fitter: Fitter, found: SearchOutcome, baseline: Healthy, held_out: HeldOutPoints
    ) -> None:
        self._fitter = fitter
        self._held_out = held_out
        self._nominal = fitter.nominal
        self._likelihood = fitter.likelihood
        self._found = found
        self._baseline = baseline
        self._rivals = tuple(rival.ids for rival in found.rivals) if found.adequate else ()
        self._best = found.winner if found.adequate else min(found.fitted, key=lambda one: one.statistic)
        self._proposals = propose(fitter, found, baseline, held_out, self._moves)

    def discovery(self) -> Discovery:
        """Everything together."""
        found, verdict = self._found, self._verdict()
        confidence = HIGHEST if found.adequate and self._proposals else confidence_of(found)
        if not self._baseline.adequate:
            confidence = min(confidence, WITH_A_WRONG_MODEL)
        named = verdict in (Verdict.NAMED, Verdict.AMBIGUOUS)
        open_ids = [one for ids in (found.winner.ids, *self._rivals) for one in ids]
        recordings = self._likelihood.recordings
        noise = [recorded.measurement.noise for recorded in recordings]
        with_rate = any(recorded.rate_phases.size for recorded in recordings)
        after, gain = self._cells(self._best), found.nominal.statistic - found.winner.statistic
        left = max(0.0, sum(cell.samples * (cell.variance - 1.0) for cell in after))
        explained = gain / (gain + left) if gain > 0.0 else 0.0
        return Discovery(
            verdict=verdict,
            named=found.winner if named else found.nominal,
            best=self._best,
            effects=self._effects(confidence, explained) if named else (),
            rivals=self._rivals if named else (),
            ranking=self._ranking(),
            samples=float(sum(each.phases.size + each.rate_phases.size for each in recordings)),
            detection=Detection(gain, found.threshold),
            explained=explained,
            confidence=confidence,
            confidence_method=METHOD,
            unexplained=self._unexplained() if verdict is Verdict.UNKNOWN else None,
            decide_by=decide_by(open_ids, with_rate)
            if verdict is Verdict.AMBIGUOUS
            else decide_between(self._proposals, with_rate),
            before=self._cells(found.nominal),
            after=after,
            noise=NoiseLevels(
                *(
                    float(np.sqrt(np.mean([getattr(level, name) ** 2 for level in noise])))
                    for name in ("rail_pressure", "line_pressure", "needle_lift")
                )
            ),
            smallest_visible=tuple(map(self._smallest_visible, self._fitter.signatures)),
            proposals=self._proposals,
        )

    def _smallest_visible(self, one: Signature) -> SmallestVisible:
        first, size = one.effect.parameters[0], self._fitter.smallest_visible(one)
        return SmallestVisible(one.effect.id, first.name, size / first.si, first.unit)

    def _verdict(self) -> Verdict:
        if not self._found.adequate or self._proposals:
            return Verdict.UNKNOWN
        if not self._found.winner.hypothesis.effects:
            return Verdict.NONE
        return Verdict.AMBIGUOUS if self._rivals or self._found.soft else Verdict.NAMED

    def _effects(self, confidence: float, explained: float) -> tuple[FittedEffect, ...]:
        """The winner's effects. explained: share of the disagreement."""
        winner = self._found.winner
        whole, parameters = winner.model(self._nominal), self._with_intervals(winner).parameters
        gains = [self._gain(effect_id) for effect_id in winner.ids]
        result = []
        for number, (effect, gain) in enumerate(zip(winner.hypothesis.effects, gains, strict=True)):
            instead = [
                one
                for ids in self._rivals
                if set(winner.ids) - {effect.id} <= set(ids)
                for one in ids
                if one not in winner.ids
            ]
            others = tuple(dict.fromkeys((*indistinguishable(effect), *instead)))
            moves = self._moves(winner.model_without(number, self._nominal), whole)
            share = explained * gain / sum(gains)
            result.append(
                FittedEffect(effect.id, parameters[effect.id], confidence, others, share, moves, gain)
            )
        return tuple(result)

    def _gain(self, effect_id: str) -> float:
        """Rise of -2 log L without one of the winner's effects."""
        winner = self._found.winner
        rest = set(winner.ids) - {effect_id}
        without = next(one for one in self._found.fitted if set(one.ids) == rest)
        return without.statistic - winner.statistic

    def _with_intervals(self, one: Candidate) -> Candidate:
        """A candidate with the intervals of its sizes: by the information at the minimum, by how much the effect
        appears to be now more, now less, on the healthy injector, and by how exact a fitted model is."""
        variances = (INTERVAL_MARGIN * self._fitter.sigmas(one)) ** 2
        if self._baseline.appears:
            variances += (MODEL_SHARE * one.theta) ** 2
        place = 0
        for effect in one.hypothesis.effects:
            if effect.parameters:
                variances[place] += self._fitter.reference(effect)[1] ** 2
            place += len(effect.parameters)
        return replace(one, half=tuple((NORMAL_975 * np.sqrt(variances)).tolist()))

    def _moves(self, before: EffectiveModel, after: EffectiveModel) -> Consequence:
        return consequence([recorded.measurement for recorded in self._likelihood.recordings], before, after)

    def _ranking(self) -> tuple[Candidate, ...]:
        """Leaders by -2 log L, the winner, its rivals and the nominal model among them."""
        found = self._found
        leaders = sorted(found.fitted, key=lambda one: one.statistic)[:RANKED]
        chosen = dict.fromkeys((*leaders, found.winner, *found.rivals, found.nominal))
        return tuple(
            replace(
                self._with_intervals(one),
                held_out=self._held_out.statistic(one),
                moves=self._moves(self._nominal, one.model(self._nominal)),
            )
            for one in sorted(chosen, key=lambda one: one.statistic)
        )

    def _cells(self, one: Candidate) -> tuple[Cell, ...]:
        model = one.model(self._nominal)
        judged = self._likelihood.judge(model)
        return () if judged is None else cells_of(self._likelihood, judged, model)

    def _unexplained(self) -> Unexplained | None:
        found = self._found
        judged = self._likelihood.judge(found.winner.model(self._nominal))
        if judged is None:
            return None
        place = worst(pool_of(self._likelihood, judged), self._baseline)
        left = unexplained(self._likelihood, judged, self._nominal, place, found.fitted)
        if not self._proposals:
            return left
        best = self._proposals[0]
        return replace(left, equation=best.found.hypothesis.effects[0].equation, phase=best.phase)


def confidence_of(found: SearchOutcome) -> float:
    """Probability that the winner is right; of the nominal model, that nothing is missing."""
    if not found.adequate:
        return HIGHEST * (1.0 - 0.5 / found.ratio)
    winner = found.winner
    handicap = 0.0 if winner.hypothesis.effects else found.threshold  # of those who would be accepted
    others = [one for one in (*found.contenders, found.nominal) if one is not winner]
    return confidence_before(price(one) + handicap - price(winner) for one in others)


def confidence_before(behind: Iterable[float]) -> float:
    """Probability of a candidate, others being behind it by these amounts of -2 log L with its price."""
    return HIGHEST / (1.0 + sum(math.exp(min(0.0, -one / (2.0 * TEMPER))) for one in behind))


def consequence(
    measured: Sequence[Measurement], before: EffectiveModel, after: EffectiveModel
) -> Consequence:
    """By how much line pressure and mass move from one model to another."""
    pressures, masses = [], []
    for measurement in measured:
        for old, new in zip(simulated(measurement, before), simulated(measurement, after), strict=True):
            pressures.append(new.line_pressure - old.line_pressure)
            masses.append(
                mass(measurement, new, after.coefficients.density)
                - mass(measurement, old, before.coefficients.density)
            )
    squares = np.concatenate(pressures) ** 2
    return Consequence(float(np.sqrt(np.mean(squares))), float(np.mean(masses)))
