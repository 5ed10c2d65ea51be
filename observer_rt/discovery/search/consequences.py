"""What an effect does to line pressure and injected mass: a large gap in pressure need not be one in mass."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.discovery.evidence.measurement import Measurement
from observer_rt.discovery.report.gaps import winner_of
from observer_rt.discovery.report.open_loop import mass, simulated
from observer_rt.discovery.result import Candidate, Discovery
from observer_rt.discovery.search.hypothesis import Hypothesis
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import VOCABULARY


@dataclass(frozen=True)
class Consequence:
    """By how much a model moves: root mean square of the line pressure from opening to the end of the ringing [Pa],
    and mean of the injected mass [kg], over all events."""

    line_pressure: float
    mass: float


def of_candidates(
    found: Discovery, measured: Sequence[Measurement], nominal: EffectiveModel
) -> tuple[Consequence, ...]:
    """What every candidate of the ranking changes in the model as given."""
    return tuple(_consequence(measured, nominal, _model(candidate, nominal)) for candidate in found.ranking)


def of_effects(
    found: Discovery, measured: Sequence[Measurement], nominal: EffectiveModel
) -> tuple[Consequence, ...]:
    """What each effect found changes when it comes last."""
    winner, theta = winner_of(found)
    whole = winner.model(nominal, theta)
    return tuple(
        _consequence(measured, without(winner, theta, number, nominal), whole)
        for number in range(len(winner.effects))
    )


def without(
    winner: Hypothesis, theta: NDArray[np.float64], number: int, nominal: EffectiveModel
) -> EffectiveModel:
    """The model of a hypothesis at theta (p,) without one of its effects, the others at their sizes."""
    parts = list(winner.split(theta))
    rest = Hypothesis(winner.effects[:number] + winner.effects[number + 1 :])
    del parts[number]
    return rest.model(nominal, np.concatenate(parts) if parts else np.zeros(0))


def _model(candidate: Candidate, nominal: EffectiveModel) -> EffectiveModel:
    sizes = np.array([parameter.value for effect in candidate.parameters for parameter in effect])
    return Hypothesis(tuple(VOCABULARY[one] for one in candidate.ids)).model(nominal, sizes)


def _consequence(
    measured: Sequence[Measurement], before: EffectiveModel, after: EffectiveModel
) -> Consequence:
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
