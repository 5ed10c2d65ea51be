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
    Ringing,
    Tabulated,
)
from observer_rt.model.terms.term import Term, TermEquation
from observer_rt.model.terms.variable import Variable

Numbers = NDArray[np.float64]

_NUMBER = len(Operation)  # operand: the value
_VARIABLE = _NUMBER + 1  # which
_LAG = _NUMBER + 2  # ms
_RINGING = _NUMBER + 3  # behind two numbers, frequency in kHz and damping
_END = _NUMBER + 4  # of a term of this equation
_DAMPED = 0.99  # of what rings no more
_SENSOR = TermEquation.LINE_PRESSURE_SENSOR.number
_BOUNDS = np.array([equation.bounds for equation in TermEquation])


def program_of(terms: Sequence[Term], known: Mapping[Variable, float] = MappingProxyType({})) -> Numbers:
    """The program (n, 2) of these terms, the sensor's last; no rows for no terms.

    known: variables that stay as they are.
    """
    rows: list[tuple[float, float]] = []
    for term in sorted(terms, key=lambda term: term.equation is TermEquation.LINE_PRESSURE_SENSOR):
        rows.extend(_rows(term.law, term.coefficient, known))
        rows.append((_END, term.equation.number))
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


@compiled
def fresh_memory(program: Numbers) -> Numbers:
    """A memory (3 n,) for a program: what rows remember of laws and of innovations, nothing yet; its stack."""
    return np.full(3 * program.shape[0], math.nan)


@compiled
def reads(program: Numbers, variable: int) -> bool:
    """Whether a law of a program has this variable."""
    return bool(np.any((program[:, 0] == _VARIABLE) & (program[:, 1] == variable)))


@compiled
def sensor_rows(program: Numbers) -> int:
    """From which row on a program is the sensor's."""
    first = 0
    for row in range(program.shape[0]):
        if program[row, 0] == _END and program[row, 1] != _SENSOR:
            first = row + 1
    return first


@inner
def run_program(
    program: Numbers,
    rows: tuple[int, int],
    variables: Numbers,
    memory: Numbers,
    interval_ms: float,
    totals: Numbers,
) -> None:
    """Terms from one row up to another at one moment, added up by equation into `totals` (10,).

    variables: in the order and units of `Variable`, totals: of `TermEquation`. memory: of `fresh_memory`; what it
    remembers moves on by `interval_ms`, at 0 it stays. Every term, and every total, is held within its equation's
    bounds; a term that is not finite is 0.
    """
    totals[:] = 0.0
    top = memory.shape[0]  # the stack grows downwards, from the end
    for row in range(*rows):
        operation, operand = int(program[row, 0]), program[row, 1]
        if operation == _NUMBER:
            top -= 1
            memory[top] = operand
        elif operation == _VARIABLE:
            top -= 1
            memory[top] = variables[int(operand)]
        elif operation == _LAG:
            memory[row] = memory[top] = _lagged(memory[row], memory[top], interval_ms / operand)
        elif operation == _RINGING:
            top += 2
            memory[top] = _rung(memory, row - 2, memory[top], memory[top - 1], memory[top - 2], interval_ms)
        elif operation == _END:
            place = int(operand)
            totals[place] = _held(totals[place] + _held(memory[top], place), place)
            top += 1
        elif _takes_two(operation):
            memory[top + 1] = _of_two(operation, memory[top + 1], memory[top])
            top += 1
        else:
            memory[top] = _of_one(operation, memory[top])


@inner
def without_ringing(program: Numbers, memory: Numbers, innovation: float, interval_ms: float) -> float:
    """An innovation behind a notch at the frequency of every resonance of the sensor."""
    rows = program.shape[0]
    for row in range(sensor_rows(program), rows):
        if program[row, 0] == _RINGING:
            kilohertz, damping, place = program[row - 2, 1], program[row - 1, 1], rows + row - 2
            _rung(memory, place, innovation, kilohertz, _DAMPED, interval_ms)
            swing = memory[place + 2] / (2.0 * math.pi * kilohertz)
            innovation -= 2.0 * (_DAMPED - damping) * swing
    return innovation


@compiled
def totals_of(program: Numbers, variables: Numbers, memory: Numbers, interval_ms: float) -> Numbers:
    """`run_program` over many moments: variables (n, 19), totals (n, 10)."""
    totals = np.empty((variables.shape[0], _BOUNDS.shape[0]))
    for k in range(variables.shape[0]):
        run_program(program, (0, program.shape[0]), variables[k], memory, interval_ms, totals[k])
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
        case Ringing(argument, kilohertz, damping):
            yield from _rows(argument, c, known)
            yield _NUMBER, kilohertz
            yield _NUMBER, damping
            yield _RINGING, 0.0
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
def _rung(
    memory: Numbers, place: int, now: float, kilohertz: float, damping: float, interval_ms: float
) -> float:
    """What a resonance adds at the end of an interval over which its input is a straight line.

    memory: from the place on the input, what is added to it, and how fast the sum changes; begun anew where one is
    not finite.
    """
    before, added, change = memory[place], memory[place + 1], memory[place + 2]
    if not math.isfinite(before + added + change):
        added, change = 0.0, 0.0
    elif interval_ms > 0.0:
        turn = 2.0 * math.pi * kilohertz
        fade, swing = damping * turn, turn * math.sqrt(1.0 - damping * damping)
        slope = (now - before) / interval_ms
        steady = -2.0 * damping / turn * slope  # where it would settle on this line
        off, rate = added - steady, change - slope
        left = math.exp(-fade * interval_ms)
        cosine, sine = math.cos(swing * interval_ms), math.sin(swing * interval_ms) / swing
        added = steady + left * (off * cosine + (rate + fade * off) * sine)
        change = slope + left * (rate * cosine - (turn * turn * off + fade * rate) * sine)
    memory[place], memory[place + 1], memory[place + 2] = now, added, change
    return float(added)


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
