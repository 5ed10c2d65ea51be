"""Terms as one program, which compiled code interprets, so that no law needs a compiler.

A program is postfix, in rows of operation and operand. The end of a term adds the top of the stack to the total of
its equation.
"""

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import OP_END, OP_LAG, OP_NUMBER, OP_RINGING, OP_VARIABLE
from observer_rt.model.terms.law import Call, Coefficient, Lag, Law, LawTable, Number, Quantity, Resonance
from observer_rt.model.terms.term import Term, TermEquation
from observer_rt.model.terms.variable import Variable

Numbers = NDArray[np.float64]


def program_of(terms: Sequence[Term], fixed: Mapping[Variable, float] = MappingProxyType({})) -> Numbers:
    """The program (n, 2) of terms, those of the sensor last; fixed: variables that are constants."""
    rows: list[tuple[float, float]] = []
    for term in sorted(terms, key=lambda term: term.equation is TermEquation.LINE_PRESSURE_SENSOR):
        rows.extend(_rows(term.law, term.coefficient, fixed))
        rows.append((OP_END, term.equation.number))
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _rows(law: Law, c: float, fixed: Mapping[Variable, float]) -> Iterator[tuple[float, float]]:
    match law:
        case Number():
            yield OP_NUMBER, law.reckoned
        case Coefficient():
            yield OP_NUMBER, c
        case Quantity(variable):
            yield (OP_NUMBER, fixed[variable]) if variable in fixed else (OP_VARIABLE, variable)
        case Lag(argument, milliseconds):
            yield from _rows(argument, c, fixed)
            yield OP_LAG, milliseconds
        case Resonance(argument, kilohertz, damping):
            yield from _rows(argument, c, fixed)
            yield OP_NUMBER, kilohertz
            yield OP_NUMBER, damping
            yield OP_RINGING, 0.0
        case LawTable():
            yield from _rows(law.spelled, c, fixed)
        case Call(operation, arguments):
            for argument in arguments:
                yield from _rows(argument, c, fixed)
            yield operation, 0.0
