"""What a small coefficient of every candidate law does to the innovations, and what it promises."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from observer_rt.identification.ode.fitting import FittedOde, OdeFit, SizedLaw
from observer_rt.identification.ode.laws import CandidateLaw

STEP = 1e-3  # of a coefficient: share of what the equation has anyway


def promising(fit: OdeFit, here: FittedOde, candidates: Sequence[CandidateLaw], count: int) -> list[SizedLaw]:
    """Candidates with the largest gains were all linear, at most so many, with the coefficients that they gain with.

    What parameters and laws in force could do as well is taken off.
    """
    basis, _ = np.linalg.qr(here.jacobian)
    found: list[tuple[float, SizedLaw]] = []
    for law in candidates:
        sized = [
            one for start in _small(fit, here, law) if (one := _scored(fit, here, basis, start)) is not None
        ]
        found += [max(sized, key=lambda one: one[0])] if sized else []
    found.sort(key=lambda one: -one[0])
    return [law for gain, law in found[:count] if gain > 0.0]


def _scored(
    fit: OdeFit, here: FittedOde, basis: NDArray[np.float64], small: SizedLaw
) -> tuple[float, SizedLaw] | None:
    """The gain of -2 log L of a law along its signature, and its coefficient there."""
    there = fit.residuals(here.q, (*here.laws, small))
    if there is None:
        return None
    slope = (there - here.z) / small.coefficient
    slope -= basis @ (basis.T @ slope)
    length = float(slope @ slope)
    if length == 0.0:
        return None
    law = small.candidate
    size = min(max(-float(slope @ here.z) / length, law.lowest), law.highest)
    return -2.0 * size * float(slope @ here.z) - size**2 * length, SizedLaw(law, size, small.numbers)


def _small(fit: OdeFit, here: FittedOde, law: CandidateLaw) -> Iterator[SizedLaw]:
    """A law at each of its numbers, its coefficient a small share of what its equation has anyway."""
    states = fit.states(here.q, here.laws)
    assert states is not None  # it was fitted
    parameters, place = fit.parameters(here.q), list(fit.model.states).index(law.equation)
    every = [(one.system, x) for one, x in zip(fit.stretches, states, strict=True)]
    own = np.concatenate([system.rates(parameters, x)[:, place] for system, x in every])
    tried: list[tuple[float, ...]] = [(number,) for number in law.numbers] or [()]
    for numbers in tried:
        acts = np.concatenate([system.along(x, law.law, numbers) for system, x in every])
        size = math.sqrt(float(np.mean(acts**2)))
        step = STEP * math.sqrt(float(np.mean(own**2))) / size if 0.0 < size < math.inf else 0.0
        if step > 0.0:
            yield SizedLaw(law, step if law.highest > 0.0 else -step, numbers)
