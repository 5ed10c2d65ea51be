"""Where the best model still fails, which equation is violated, and what the excess depends on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.discovery.search.adequacy import SIGNIFICANT, Worst
from observer_rt.discovery.search.result import Candidate, Unexplained
from observer_rt.evidence.likelihood import Evidence, JudgedModel
from observer_rt.evidence.pooled import Signal
from observer_rt.model.effect import Equation
from observer_rt.model.effective import EffectiveModel

BLOCK = 8  # samples whose mean is looked at
MATTERS = 0.1  # of the largest standardised slope, below which a dependence is not named


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Scaled means of blocks of residuals (b,), and what they may depend on (b, names)."""

    means: NDArray[np.float64]
    regressors: NDArray[np.float64]


NAMES = ("rail pressure", "needle lift", "injection rate", "duration")


def unexplained(
    evidence: Evidence,
    judged: Sequence[JudgedModel],
    nominal: EffectiveModel,
    place: Worst,
    fitted: Sequence[Candidate],
) -> Unexplained:
    """What is left in the phase and signal a model explains worst.

    The equation is that of the effect which explains most when nothing explains all.
    """
    blocks = _blocks(evidence, judged, nominal, place)
    depends_on = _dependence(blocks)
    equation = _equation(fitted)
    sign = "more" if float(np.mean(blocks.means)) > 0.0 else "less"
    what = "line pressure" if place.signal is Signal.LINE_PRESSURE else "injection rate"
    term = f"measured {what} is {sign} than modelled"
    if depends_on:
        term += f"; the difference changes with {' and '.join(depends_on)}"
    return Unexplained(equation, place.phase, place.signal, depends_on, term)


def _equation(fitted: Sequence[Candidate]) -> Equation:
    """Of the leading effect among all singles."""
    singles = [one for one in fitted if len(one.hypothesis.effects) == 1]
    best = min(singles, key=lambda one: one.statistic)
    return best.hypothesis.effects[0].equation


def _blocks(
    evidence: Evidence, judged: Sequence[JudgedModel], nominal: EffectiveModel, place: Worst
) -> _Blocks:
    means, regressors = [], []
    for trial, one in zip(evidence.trials, judged, strict=True):
        at_line = place.signal is Signal.LINE_PRESSURE
        z = one.z if at_line else one.rate_z[:-1]
        phases = trial.phases if at_line else trial.rate_phases
        lift, rate = trial.lift_and_rate(nominal, at_line)
        chosen = np.flatnonzero(phases == place.phase)
        for block in np.split(chosen, np.flatnonzero(np.diff(chosen) > 1) + 1):
            for first in range(0, block.size - BLOCK + 1, BLOCK):
                rows = block[first : first + BLOCK]
                means.append(float(z[rows].sum()) / np.sqrt(BLOCK))
                measurement = trial.measurement
                regressors.append(
                    (measurement.rail_pressure, lift[rows].mean(), rate[rows].mean(), measurement.duration)
                )
    return _Blocks(np.array(means), np.array(regressors).reshape(-1, len(NAMES)))


def _dependence(blocks: _Blocks) -> tuple[str, ...]:
    """Names of what the means of blocks depend on, most important first: significant standardised slopes."""
    spread = blocks.regressors.std(axis=0) if len(blocks.means) else np.zeros(len(NAMES))
    varying = np.flatnonzero(spread > 1e-9 * np.abs(blocks.regressors).max(axis=0, initial=0.0))
    if len(blocks.means) <= varying.size + 1 or varying.size == 0:
        return ()
    centred = blocks.regressors[:, varying] - blocks.regressors[:, varying].mean(axis=0)
    design = np.column_stack((np.ones(len(blocks.means)), centred / spread[varying]))
    slopes, *_ = np.linalg.lstsq(design, blocks.means, rcond=None)
    left = blocks.means - design @ slopes
    variance = max(1.0, float(left @ left) / (len(left) - design.shape[1]))
    sigma = np.sqrt(np.diag(np.linalg.pinv(design.T @ design)) * variance)
    size, sigma = np.abs(slopes[1:]), sigma[1:]
    important = [
        i for i in np.argsort(-size) if size[i] > SIGNIFICANT * sigma[i] and size[i] > MATTERS * size.max()
    ]
    return tuple(NAMES[varying[i]] for i in important)
