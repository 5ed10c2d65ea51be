"""Proposals that leave something: whether a model may have them in part, what they leave being its uncertainty."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.whitening import HUBER
from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.identification.discovery.search.hypothesis import Hypothesis, Sizing
from observer_rt.identification.discovery.search.proposals import unsound
from observer_rt.identification.discovery.search.results import (
    TOO_FREE,
    TOO_MANY,
    Candidate,
    Cell,
    Part,
    Proposal,
    Refusal,
)
from observer_rt.identification.discovery.search.search import HeldOutPoints
from observer_rt.identification.discovery.search.verdict import consequence
from observer_rt.identification.likelihood.bounded_fit import fit
from observer_rt.identification.likelihood.likelihood import JointLikelihood, Signal
from observer_rt.identification.likelihood.open_loop import mean_mass
from observer_rt.model.baseline import PhaseFigures
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.term_effect import is_term
from observer_rt.model.terms.law import Number
from observer_rt.model.terms.term import Term, TermEquation

LEAST_CLOSED = 2.0 / 3.0  # of the gap held out
SIGMAS, SHARE = 3.0, 0.25  # by which a coefficient may differ at an operating point, beside its own interval
_PROBE = Term(
    TermEquation.NOZZLE_FLOW, Number(0.02)
)  # so small that pressure and mass follow it in proportion
_MORE = "record more rail pressures and durations, or the injection rate as well"

Floats = NDArray[np.float64]


def with_parts(
    proposals: Sequence[Proposal], likelihood: JointLikelihood, nominal: EffectiveModel
) -> tuple[Proposal, ...]:
    """Proposals, with what may be accepted of those that leave something but have no other objection.

    Where the first piles up laws and leaves something all the same, its best law alone is one more.
    """
    if proposals and not proposals[0].adequate and proposals[0].objection in (TOO_MANY, TOO_FREE):
        proposals = (*proposals, *_best_law(proposals[0], likelihood, nominal))
    judged = _Judged(proposals, likelihood, nominal)
    lift = nominal.injector.seat.max_lift
    return tuple(replace(judged.with_part(one), largest_lift=lift) for one in proposals)


def _best_law(whole: Proposal, likelihood: JointLikelihood, nominal: EffectiveModel) -> Iterator[Proposal]:
    """The law of a proposal that explains most alone, fitted so; nothing without a solution."""
    measured = [recorded.measurement for recorded in likelihood.recordings]
    found: list[Candidate] = []
    for effect, size in zip(whole.found.hypothesis.effects, whole.found.sizes, strict=True):
        alone = Hypothesis((effect,))
        fitted = fit(Sizing(likelihood, nominal, alone), np.array([size]), alone.ranges())
        if fitted is not None and is_term(effect):
            found.append(Candidate.fitted(alone, fitted.theta, fitted.statistic, fitted.sigmas()))
    if found:
        best = min(found, key=lambda one: one.statistic)
        model, gap = best.model(nominal), HeldOutPoints(likelihood, nominal).gap(best)
        yield replace(
            whole,
            found=replace(best, moves=consequence(measured, nominal, model)),
            gain=whole.gain + whole.found.statistic - best.statistic,
            unsound=unsound(model, nominal),
            held_out=(whole.held_out[0], gap),
            curves=(),
            lost=(),
            alternatives=(),
        )


class _Judged:
    """Proposals beside each other."""

    def __init__(
        self, proposals: Sequence[Proposal], likelihood: JointLikelihood, nominal: EffectiveModel
    ) -> None:
        self._proposals = proposals
        self._likelihood = likelihood
        self._nominal = nominal
        self._measured = [recorded.measurement for recorded in likelihood.recordings]

    def with_part(self, one: Proposal) -> Proposal:
        if one.adequate or one.objection is not None or math.isnan(one.held_out[0]):
            return one
        noise = float(np.mean([each.noise.line_pressure**2 for each in self._measured]))
        before, after = (math.sqrt(max(gap**2 - noise, 0.0)) for gap in one.held_out)
        if not before > 0.0:
            return one
        half = self._mass_half(one, after)
        closed = 1.0 - after / before
        return replace(one, part=Part(closed, after, half, self._refusal(one, closed, half)))

    def _refusal(self, one: Proposal, closed: float, half: float) -> Refusal | None:
        if closed < LEAST_CLOSED:
            return Refusal(f"it closes {max(closed, 0.0):.0%} of the gap held out, not two thirds", _MORE)
        apart = _disagreement(one.found, self._likelihood, self._nominal)
        if apart is not None:
            return Refusal(f"its size is not the same at all operating points ({apart})", _MORE)
        interval = half * mean_mass(self._measured, one.model(self._nominal))
        rivals = [other for other in self._proposals if other is not one]
        others = (*(other.found for other in rivals), *one.alternatives)
        differs = max((each.moves.mass - one.found.moves.mass for each in others), key=abs, default=0.0)
        if abs(differs) > interval:
            return Refusal(
                f"a law of another equation that explains as much would inject {differs / MILLIGRAM:+.2g} mg, beyond "
                f"the interval of ±{interval / MILLIGRAM:.2g} mg",
                "measure the injection rate or the mass",
            )
        return None

    def _mass_half(self, one: Proposal, left: float) -> float:
        """Half width of the 95 % interval of a mass, as a share: what a change of the nozzle would make of it that
        leaves as much in the line pressure."""
        model = one.model(self._nominal)
        moved = consequence(self._measured, model, model.with_term(_PROBE))
        return left / moved.line_pressure * abs(moved.mass) / mean_mass(self._measured, model)


def _disagreement(found: Candidate, likelihood: JointLikelihood, nominal: EffectiveModel) -> str | None:
    """Sizes of a recording that differ from those of all together, in words; None where all agree."""
    sizes, sigmas = sizes_by_recording(found, likelihood, nominal)
    apart = np.abs(sizes - found.theta) - SIGMAS * sigmas - SHARE * np.abs(found.theta)
    recording, number = np.unravel_index(int(np.argmax(apart)), apart.shape)
    if not apart[recording, number] > 0.0:
        return None
    return f"{sizes[recording, number]:.3g} at one, {found.sizes[number]:.3g} at all"


def sizes_by_recording(
    found: Candidate, likelihood: JointLikelihood, nominal: EffectiveModel
) -> tuple[Floats, Floats]:
    """Sizes (recordings, p) that each recording alone says, and their standard deviations, linearised about all's."""
    sizing, ranges = Sizing(likelihood, nominal, found.hypothesis), found.hypothesis.ranges()
    here = sizing.residuals(found.theta)
    moved = [sizing.residuals(found.theta + step) for step in np.diag([one.step for one in ranges])]
    assert here is not None
    slopes = np.column_stack(
        [
            (there.z - here.z) / one.step if there is not None else np.zeros_like(here.z)
            for there, one in zip(moved, ranges, strict=True)
        ]
    )
    weights = np.minimum(1.0, HUBER / np.maximum(np.abs(here.z), HUBER))
    widest = np.diag([1.0 / max(abs(one.lowest), abs(one.highest)) ** 2 for one in ranges])
    sizes, sigmas = [], []
    ends = np.cumsum(here.counts)[1::2]  # line pressure and rate in turn
    for rows in np.split(np.arange(here.z.size), ends[:-1]):
        along, weight, left = slopes[rows], weights[rows], here.z[rows]
        covariance = np.linalg.inv((along.T * weight) @ along + widest)
        spread = max(1.0, float(np.mean(weight * left**2)))
        sizes.append(found.theta - covariance @ (along.T @ (weight * left)))
        sigmas.append(np.sqrt(np.diag(covariance) * spread))
    return np.array(sizes), np.array(sigmas)


def variance_by_phase(cells: Sequence[Cell]) -> PhaseFigures:
    """Mean square of the line pressure's normalised innovations by phase, of the recording with the most left."""
    worst: dict[str, float] = {}
    for cell in cells:
        if cell.signal is Signal.LINE_PRESSURE:
            name = Phase(cell.phase).name
            worst[name] = max(worst.get(name, 0.0), cell.variance)
    return PhaseFigures.of(worst)
