"""A library of candidate laws: those that physics uses often, of every state and input of a model."""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.errors import UserError
from observer_rt.identification.ode.fitting import OdeFit, OdeStretch
from observer_rt.identification.ode.laws import CandidateLaw
from observer_rt.identification.ode.model import OdeModel, OdeRecording, System, Values

KINKS = (0.2, 0.4, 0.6, 0.8)  # quantiles of a quantity, at which kinks are tried
NOISE = 0.01  # of an output's scatter, taken for its noise while states are looked at


def common_laws(
    model: OdeModel, recordings: Sequence[OdeRecording], equations: Sequence[str] | None = None
) -> list[CandidateLaw]:
    """Laws of every state and input, for these equations or all: powers, signs, roots, kinks, and products of two.

    equations: states whose derivatives they may be missing in. Raises `UserError` where the model has no solution.
    """
    ranges = _ranges(model, recordings)
    found = []
    for equation in equations or model.states:
        found.append(CandidateLaw(equation, "1", lambda x, u: 1.0))
        for name, values in ranges.items():
            found += _of_one(equation, name, values)
        found += [_product(equation, one, other) for one, other in combinations(ranges, 2)]
    return found


def _ranges(model: OdeModel, recordings: Sequence[OdeRecording]) -> dict[str, NDArray[np.float64]]:
    """Values (n,) that states, corrected by the outputs, and inputs take."""
    systems = [System(model, recording) for recording in recordings]
    stretches = [
        OdeStretch(one, slice(None), NOISE * np.std(one.measured, axis=0) + 1e-12) for one in systems
    ]
    fit = OdeFit(model, stretches, list(model.states)).started()
    states = None if fit is None else fit.states(fit.at_start)
    if states is None:
        raise UserError("the model", "has no finite solution", "give other start values of its parameters")
    found = dict(zip(model.states, np.concatenate(states).T, strict=True))
    for name in recordings[0].inputs:
        found[name] = np.concatenate([np.asarray(one.inputs[name], float) for one in recordings])
    return found


def value_of(name: str) -> Callable[[Values, Values], float]:
    """Reads a state or input by name."""
    return lambda x, u: getattr(x, name) if hasattr(x, name) else getattr(u, name)


def _of_one(equation: str, name: str, values: NDArray[np.float64]) -> Iterator[CandidateLaw]:
    q = value_of(name)
    yield CandidateLaw(equation, name, q)
    yield CandidateLaw(equation, f"{name}^3", lambda x, u: q(x, u) ** 3)
    yield CandidateLaw(equation, f"{name}^2", lambda x, u: q(x, u) ** 2)
    if values.min() < 0.0 < values.max():
        yield CandidateLaw(equation, f"{name}*abs({name})", lambda x, u: q(x, u) * abs(q(x, u)))
        yield CandidateLaw(equation, f"sign({name})", lambda x, u: float(np.sign(q(x, u))))
        yield CandidateLaw(equation, f"abs({name})", lambda x, u: abs(q(x, u)))
    else:
        yield CandidateLaw(equation, f"sqrt({name})", lambda x, u: math.sqrt(abs(q(x, u))))
    kinks = tuple(np.quantile(values, KINKS).tolist())
    yield CandidateLaw(equation, f"max({name} - {{}}, 0)", lambda x, u, a: max(q(x, u) - a, 0.0), kinks)


def _product(equation: str, one: str, other: str) -> CandidateLaw:
    p, q = value_of(one), value_of(other)
    return CandidateLaw(equation, f"{one}*{other}", lambda x, u: p(x, u) * q(x, u))
