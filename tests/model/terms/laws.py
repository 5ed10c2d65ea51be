"""Random laws and values of their variables, for properties that hold for all."""

import numpy as np
from hypothesis import strategies as st
from scipy.signal import lsim

from observer_rt.core.model.model import Operation
from observer_rt.foundation.units import Floats
from observer_rt.model.terms import law as language
from observer_rt.model.terms.bounds import TermDomain, by_variable
from observer_rt.model.terms.law import Call, Coefficient, Lag, Law, LawTable, Memory, Number, Quantity, Resonance
from observer_rt.model.terms.variable import Variable

_VALUES = st.floats(-1e6, 1e6, allow_nan=False).map(lambda value: float(f"{value:.6g}"))
_LEAVES = st.one_of(
    st.builds(Number, _VALUES, st.sampled_from(["", "", "MPa", "bar", "mm3/ms", "1/ms^0.5"])),
    st.just(Coefficient()),
    st.builds(Quantity, st.sampled_from(Variable)),
)
_TWO = [one for one in Operation if one <= Operation.LESS and one is not Operation.POWER] + list(language.PAIRS)
_ONE = [Operation.NEGATE, *(one for one in language.FUNCTIONS.values() if one not in language.PAIRS)]
_POINTS = (Number(-20.0), Number(0.125), Number(0.5), Number(80.0, "MPa"))
_EXPONENTS = st.sampled_from([-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0]).map(Number)


def laws(lagged: bool = True) -> st.SearchStrategy[Law]:
    """Laws of any kind, right by their units or not."""

    def larger(part: st.SearchStrategy[Law]) -> st.SearchStrategy[Law]:
        choices: list[st.SearchStrategy[Law]] = [
            st.builds(Call, st.sampled_from(_TWO), st.tuples(part, part)),
            st.builds(Call, st.sampled_from(_ONE), st.tuples(part)),
            st.builds(Call, st.just(Operation.POWER), st.tuples(part, _EXPONENTS)),
            st.builds(LawTable, part, st.just(_POINTS), st.tuples(*[_VALUES.map(Number)] * len(_POINTS))),
        ]
        if lagged:
            choices.append(st.builds(Lag, part, st.sampled_from([0.01, 0.25, 3.0])))
            choices.append(st.builds(Resonance, part, st.just(7.25), st.sampled_from([0.02, 0.5])))
        return st.one_of(choices)

    return st.recursive(_LEAVES, larger, max_leaves=12)


def moments(seed: int, count: int = 40) -> dict[str, Floats]:
    random, boxes = np.random.default_rng(seed), TermDomain(0.24).boxes(Variable)
    low, high = boxes[..., random.integers(0, boxes.shape[2], count)].swapaxes(0, 1)
    shares = np.where(
        random.random(low.shape) < 0.5, random.integers(0, 3, low.shape) / 2.0, random.random(low.shape)
    )
    places = by_variable(np.array([low + shares * (high - low)] * 2).swapaxes(0, 1))
    values = {variable.word: places[variable, 0] for variable in Variable}
    samples = np.arange(count, dtype=np.float64)
    values |= {"time": 1e-5 * samples, "injection_number": 1.0 + np.floor(0.1 * samples)}
    return values


def sampled(interval_ms: float) -> Memory:
    """What laws that remember make of samples so far apart [ms], held for a lag, straight lines for a resonance."""

    def remembered(law: Lag | Resonance, values: Floats) -> Floats:
        now = values[0]
        before = now - now[0]
        times = interval_ms * np.arange(now.size)
        if isinstance(law, Lag):
            system, held = ([1.0], [law.milliseconds, 1.0]), np.append(before[1:], 0.0)
            return np.asarray([now[0] + lsim(system, held, times, interp=False)[1]] * 2)
        turn = 2.0 * np.pi * law.kilohertz
        system = ([turn**2], [1.0, 2.0 * law.damping * turn, turn**2])
        return np.asarray([lsim(system, before, times)[1] - before] * 2)

    return remembered
