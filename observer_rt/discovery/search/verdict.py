"""Which effect is missing: from recordings to the verdict."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from observer_rt.discovery.evidence.measurement import Measurement, every_second_point
from observer_rt.discovery.result import (
    Candidate,
    Cell,
    Discovery,
    FittedEffect,
    FittedParameter,
    Unexplained,
    Verdict,
)
from observer_rt.discovery.search.adequacy import (
    NO_BASELINE,
    HealthyBaseline,
    baseline_of,
    cells_of,
    pool_of,
    worst,
)
from observer_rt.discovery.search.bounded_fit import NORMAL_975, Fit, fit, linearise
from observer_rt.discovery.search.candidates import FitMemory, Fitter, Sized
from observer_rt.discovery.search.confidence import METHOD, WITH_A_WRONG_MODEL, confidence_of
from observer_rt.discovery.search.decisive import decide_by
from observer_rt.discovery.search.hypothesis import Sizing
from observer_rt.discovery.search.likelihood import Evidence, evidence_of
from observer_rt.discovery.search.search import Found, Search, indistinguishable, representatives
from observer_rt.discovery.search.unexplained import unexplained
from observer_rt.estimation.gain import NoiseLevels
from observer_rt.foundation.errors import RunError
from observer_rt.model.effective import EffectiveModel

RANKED = 8  # candidates listed
INTERVAL_MARGIN = (
    1.08  # for what a steady gain does not know: errors on independent plants are that much larger
)
_EXPECTED_MORE = 10  # fits of a usual search after the first of every effect, for the progress shown

Progress = Callable[[float], None]
"""Called with the share done, 0 to 1."""


@dataclass(frozen=True)
class Options:
    """How to search. workers: threads; memory: of candidates fitted before; baseline: of healthy recordings."""

    workers: int = 1
    memory: FitMemory | None = None
    progress: Progress | None = None
    baseline: HealthyBaseline = NO_BASELINE


def name_effects(
    nominal: EffectiveModel, found: Sequence[Measurement], options: Options | None = None
) -> Discovery:
    """The missing effects, fitted to all recordings.

    Raises `RunError` when the nominal model has no finite solution on them.
    """
    options = options or Options()
    evidence = evidence_of(found, nominal)
    effects = representatives()
    done = 0

    def count(_: Sized) -> None:
        nonlocal done
        done += 1
        if options.progress is not None:
            options.progress(min(1.0, done / (len(effects) + _EXPECTED_MORE)))

    if evidence.judge(nominal) is None:
        raise RunError("the model has no finite solution on these recordings: see `observer-rt check`")
    fitter = Fitter(evidence, nominal, options.workers, options.memory, count)
    result = _Verdict(fitter, Search(fitter, effects, options.baseline).run(), options.baseline).discovery()
    if options.progress is not None:
        options.progress(1.0)
    return result


def healthy_baseline(
    nominal: EffectiveModel, found: Sequence[Measurement], workers: int = 1
) -> tuple[HealthyBaseline, Discovery]:
    """What healthy recordings leave unexplained, and what discovery says of them: `none` for an adequate model."""
    evidence = evidence_of(found, nominal)
    judged = evidence.judge(nominal)
    if judged is None:
        raise RunError("the model has no finite solution on the healthy recordings: see `observer-rt check`")
    discovery = name_effects(nominal, found, Options(workers))
    baseline = baseline_of(pool_of(evidence, judged))
    gain = discovery.gain / discovery.ranking[0].samples
    return replace(baseline, trusted=discovery.verdict is Verdict.NONE, gain=gain), discovery


class _Verdict:
    """The result of a search in the words of a `Discovery`."""

    def __init__(self, fitter: Fitter, found: Found, baseline: HealthyBaseline) -> None:
        self._nominal = fitter.nominal
        self._evidence = fitter.evidence
        self._found = found
        self._baseline = baseline
        self._rivals = tuple(rival.hypothesis.ids for rival in found.rivals) if found.adequate else ()

    def discovery(self) -> Discovery:
        """Everything together."""
        found, verdict = self._found, self._verdict()
        confidence = confidence_of(found)
        if not self._baseline.trusted:
            confidence = min(confidence, WITH_A_WRONG_MODEL)
        named = verdict in (Verdict.NAMED, Verdict.AMBIGUOUS)
        effects = self._effects(confidence) if named else ()
        open_ids = [one for ids in (found.winner.hypothesis.ids, *self._rivals) for one in ids]
        noise = [trial.measurement.noise for trial in self._evidence.trials]
        return Discovery(
            verdict=verdict,
            effects=effects,
            rivals=self._rivals if named else (),
            ranking=self._ranking(),
            gain=found.nominal.statistic - found.winner.statistic,
            threshold=found.threshold,
            confidence=confidence,
            confidence_method=METHOD,
            unexplained=self._unexplained() if verdict is Verdict.UNKNOWN else None,
            decide_by=decide_by(open_ids) if verdict is Verdict.AMBIGUOUS else (),
            before=self._cells(found.nominal),
            after=self._cells(found.winner),
            noise=NoiseLevels(
                *(
                    float(np.sqrt(np.mean([getattr(level, name) ** 2 for level in noise])))
                    for name in ("rail_pressure", "line_pressure", "needle_lift")
                )
            ),
            rate_noise=self._rate_noise(),
        )

    def _rate_noise(self) -> float | None:
        """Mean over the recordings with a measured rate [m3/s]."""
        levels = [trial.measurement.rate_noise for trial in self._evidence.trials if trial.rate_phases.size]
        return float(np.mean(levels)) if levels else None

    def _verdict(self) -> Verdict:
        if not self._found.adequate:
            return Verdict.UNKNOWN
        if not self._found.winner.hypothesis.effects:
            return Verdict.NONE
        return Verdict.AMBIGUOUS if self._rivals or self._found.soft else Verdict.NAMED

    def _effects(self, confidence: float) -> tuple[FittedEffect, ...]:
        """The winner's effects; of a pair each is as sure as the whole."""
        winner = self._found.winner
        result = []
        for number, parameters in enumerate(self._parameters(winner)):
            effect = winner.hypothesis.effects[number]
            instead = [
                one
                for ids in self._rivals
                if set(winner.hypothesis.ids) - {effect.id} <= set(ids)
                for one in ids
                if one not in winner.hypothesis.ids
            ]
            others = tuple(dict.fromkeys((*indistinguishable(effect), *instead)))
            result.append(FittedEffect(effect.id, parameters, self._gain(effect.id), confidence, others))
        return tuple(result)

    def _gain(self, effect_id: str) -> float:
        """What -2 log L rises without one of the winner's effects."""
        winner = self._found.winner
        rest = set(winner.hypothesis.ids) - {effect_id}
        without = next(one for one in self._found.fitted if set(one.hypothesis.ids) == rest)
        return without.statistic - winner.statistic

    def _parameters(self, sized: Sized) -> tuple[tuple[FittedParameter, ...], ...]:
        """Every effect's parameters with their intervals, from the information at the minimum."""
        hypothesis, sizing = sized.hypothesis, Sizing(self._evidence, self._nominal, sized.hypothesis)
        residuals = sizing.residuals(sized.theta)
        if residuals is None or not hypothesis.effects:
            return ()
        at = Fit(linearise(sizing, sized.theta, residuals, hypothesis.ranges()), converged=True)
        half = (
            INTERVAL_MARGIN * NORMAL_975 * at.sigmas() * math.sqrt(max(1.0, float(np.mean(residuals.z**2))))
        )
        result = []
        for effect, values, halves in zip(
            hypothesis.effects, hypothesis.split(sized.theta), hypothesis.split(half), strict=True
        ):
            result.append(
                tuple(
                    FittedParameter(
                        p.name, float(v), (max(p.lowest, float(v - h)), min(p.highest, float(v + h)))
                    )
                    for p, v, h in zip(effect.parameters, values, halves, strict=True)
                )
            )
        return tuple(result)

    def _ranking(self) -> tuple[Candidate, ...]:
        """Leaders by -2 log L, the winner, its rivals and the nominal model among them."""
        found = self._found
        chosen = sorted(found.fitted, key=lambda one: one.statistic)[:RANKED]
        chosen += [one for one in (found.winner, *found.rivals, found.nominal) if one not in chosen]
        first, second = every_second_point([trial.measurement for trial in self._evidence.trials])
        fitted, held = (Evidence([self._evidence.trials[i] for i in part]) for part in (first, second))
        samples = sum(trial.phases.size + trial.rate_phases.size for trial in self._evidence.trials)
        return tuple(
            Candidate(
                one.hypothesis.ids,
                self._parameters(one),
                one.statistic,
                self._held_out(one, fitted, held) if second else math.nan,
                float(samples),
                one.plausible,
            )
            for one in sorted(chosen, key=lambda one: one.statistic)
        )

    def _held_out(self, one: Sized, fitted: Evidence, held: Evidence) -> float:
        """-2 log L on the held-out recordings with the sizes fitted to the others."""
        again = fit(Sizing(fitted, self._nominal, one.hypothesis), one.theta, one.hypothesis.ranges())
        if again is None:
            return math.inf
        residuals = held.residuals(one.hypothesis.model(self._nominal, again.at.theta))
        return math.inf if residuals is None else residuals.statistic

    def _cells(self, one: Sized) -> tuple[Cell, ...]:
        model = one.model(self._nominal)
        judged = self._evidence.judge(model)
        return () if judged is None else cells_of(self._evidence, judged, model)

    def _unexplained(self) -> Unexplained | None:
        found = self._found
        judged = self._evidence.judge(found.winner.model(self._nominal))
        if judged is None:
            return None
        place = worst(pool_of(self._evidence, judged), self._baseline)
        return unexplained(self._evidence, judged, self._nominal, place, found.fitted)
