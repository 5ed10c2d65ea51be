"""Terms as one program that compiled code runs, without compiling anything anew for another law.

A program is postfix: rows (operation, operand), the end of a term adds what is on the stack to its equation's total.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled, inner
from observer_rt.model.terms.law import (
    Applied,
    Coefficient,
    Lagged,
    Law,
    Number,
    Operation,
    Quantity,
    Tabulated,
)
from observer_rt.model.terms.term import Term, TermEquation
from observer_rt.model.terms.variable import Variable

Numbers = NDArray[np.float64]

_NUMBER = len(Operation)  # operand: the value
_VARIABLE = _NUMBER + 1  # which
_LAG = _NUMBER + 2  # ms
_END = _NUMBER + 3  # of a term of this equation
_BOUNDS = np.array([equation.bounds for equation in TermEquation])
_LEAVES = (_NUMBER, _VARIABLE)
_PAIRED = [one for one in Operation if one <= Operation.LESS or one >= Operation.MIN]


def program_of(terms: Sequence[Term], known: Mapping[Variable, float] = MappingProxyType({})) -> Numbers:
    """The program (n, 2) of these terms; no rows for no terms. known: variables that stay as they are."""
    rows: list[tuple[float, float]] = []
    for term in terms:
        rows.extend(_rows(term.law, term.coefficient, known))
        rows.append((_END, term.equation.number))
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def memory_of(program: Numbers) -> Numbers:
    """A fresh memory (k,) for a program: first what its lags hold, settled at what comes first, then its stack."""
    operations = program[:, 0].astype(np.int64)
    lags = int(np.count_nonzero(operations == _LAG))
    grows = np.isin(operations, _LEAVES).astype(np.int64)
    shrinks = np.isin(operations, (*_PAIRED, _END)).astype(np.int64)
    deepest = int(np.max(np.cumsum(grows - shrinks), initial=0))
    return np.full(lags + deepest, np.nan)


@inner
def run_program(
    program: Numbers, variables: Numbers, memory: Numbers, interval_ms: float, totals: Numbers
) -> None:
    """All terms at one moment, added up by equation into `totals` (10,), in the order and units of `TermEquation`.

    variables: in the order and units of `Variable`. memory: of `memory_of`; its lags move on by `interval_ms`, at 0
    they stay. Every term, and every total, is held within its equation's bounds; a term that is not finite is 0.
    """
    totals[:] = 0.0
    lag = 0
    top = memory.shape[0]  # the stack grows downwards, from the end
    for row in range(program.shape[0]):
        operation, operand = int(program[row, 0]), program[row, 1]
        if operation == _NUMBER:
            top -= 1
            memory[top] = operand
        elif operation == _VARIABLE:
            top -= 1
            memory[top] = variables[int(operand)]
        elif operation == _LAG:
            memory[lag] = memory[top] = _lagged(memory[lag], memory[top], interval_ms / operand)
            lag += 1
        elif operation == _END:
            place = int(operand)
            totals[place] = _held(totals[place] + _held(memory[top], place), place)
            top += 1
        elif _takes_two(operation):
            memory[top + 1] = _of_two(operation, memory[top + 1], memory[top])
            top += 1
        else:
            memory[top] = _of_one(operation, memory[top])


@compiled
def totals_of(program: Numbers, variables: Numbers, memory: Numbers, interval_ms: float) -> Numbers:
    """`run_program` over many moments: variables (n, 19), totals (n, 10)."""
    totals = np.empty((variables.shape[0], _BOUNDS.shape[0]))
    for k in range(variables.shape[0]):
        run_program(program, variables[k], memory, interval_ms, totals[k])
    return totals


def _rows(law: Law, c: float, known: Mapping[Variable, float]) -> Iterator[tuple[float, float]]:
    match law:
        case Number():
            yield _NUMBER, law.reckoned
        case Coefficient():
            yield _NUMBER, c
        case Quantity(variable):
            yield (_NUMBER, known[variable]) if variable in known else (_VARIABLE, variable)
        case Lagged(argument, milliseconds):
            yield from _rows(argument, c, known)
            yield _LAG, milliseconds
        case Tabulated():
            yield from _rows(law.spelled, c, known)
        case Applied(operation, arguments):
            for argument in arguments:
                yield from _rows(argument, c, known)
            yield operation, 0.0


@inner
def _lagged(before: float, now: float, intervals: float) -> float:
    """A lag's next value; one that is not a number is begun anew."""
    if not math.isfinite(before):
        return now
    return before - math.expm1(-intervals) * (now - before)


@inner
def _held(value: float, equation: int) -> float:
    if not math.isfinite(value):
        return 0.0
    return float(min(max(value, _BOUNDS[equation, 0]), _BOUNDS[equation, 1]))


@inner
def _takes_two(operation: int) -> bool:
    return operation <= Operation.LESS or operation >= Operation.MIN


@inner
def _of_two(operation: int, a: float, b: float) -> float:
    if operation == Operation.ADD:
        return a + b
    if operation == Operation.SUBTRACT:
        return a - b
    if operation == Operation.MULTIPLY:
        return a * b
    if operation == Operation.DIVIDE:
        if b != 0.0:
            return a / b
        if a == 0.0 or math.isnan(a):
            return math.nan
        return math.copysign(math.inf, a) * math.copysign(1.0, b)
    if operation == Operation.POWER:
        return a * a if b == 2.0 else float(a**b)
    if operation == Operation.GREATER:
        return 1.0 if a > b else 0.0
    if operation == Operation.LESS:
        return 1.0 if a < b else 0.0
    if math.isnan(a) or math.isnan(b):
        return math.nan
    if operation == Operation.MIN:
        return min(a, b)
    return max(a, b)


@inner
def _of_one(operation: int, a: float) -> float:
    if operation == Operation.NEGATE:
        return -a
    if operation == Operation.SQRT:
        return math.copysign(math.sqrt(abs(a)), a)
    if operation == Operation.ABS:
        return abs(a)
    if operation == Operation.EXP:
        return math.exp(a)
    if operation == Operation.LOG:
        return math.log(a)
    if operation == Operation.SIN:
        return math.sin(a)
    if operation == Operation.COS:
        return math.cos(a)
    return math.tanh(a)
