"""Parser of laws, from text to tree: some of Python's expressions, ^ for powers, and units as in `100[MPa]`.

A form is the text of a law with letters in the places of the numbers that a fit may change.
"""

import ast
import math
import re
from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate, pairwise
from typing import NamedTuple

from observer_rt.core.model.model import Operation
from observer_rt.foundation.errors import UserError, did_you_mean
from observer_rt.model.terms import law
from observer_rt.model.terms.law import Law
from observer_rt.model.terms.variable import UNIT_NAMES, VARIABLES, unit_named

LONGEST = 300  # characters
DEEPEST = 30  # parentheses within parentheses
COEFFICIENT = "c"
LARGEST = 1e300  # size of a number
_FOREIGN = re.compile(r"[^\w\s.+\-*/^(),<>\[\]]")
_OPERATIONS: dict[type[ast.AST], Operation] = {
    ast.Add: Operation.ADD,
    ast.Sub: Operation.SUBTRACT,
    ast.Mult: Operation.MULTIPLY,
    ast.Div: Operation.DIVIDE,
    ast.Gt: Operation.GREATER,
    ast.Lt: Operation.LESS,
}
_FUNCTIONS = (*law.FUNCTIONS, law.LAGGED, law.RINGING, law.TABLE)
_ARGUMENTS = {law.LAGGED: 2, law.RINGING: 3} | {one.name.lower(): 2 for one in law.PAIRS}
_REMEDY = "correct the law: numbers, variables and functions, joined by + - * / ^ > <"
EXACT_DIGITS = 3  # of a number within a law, relative to its range
LETTERS = "AWFBCDEGIJKL"
"""Letters of the first number of a form, the second and so on, as `A` and `W` in `tanh((u - A)/W)`: first a position,
a width or frequency, and a phase. H, M and P are not among them, for units have them."""
_NUMBER = re.compile(rf"(, )?([{LETTERS}])")


def parse(text: str) -> law.Law:
    """The law a text states. Raises `UserError` naming the part at fault, and what was expected."""
    if len(text) > LONGEST:
        raise UserError("law", f"is longer than {LONGEST} characters", "make it shorter")
    if foreign := _FOREIGN.search(text):
        raise UserError(f"column {foreign.start() + 1}", f"'{foreign[0]}' is in no law", _REMEDY)
    levels = [0, *accumulate((one == "(") - (one == ")") for one in text)]
    if not 0 <= min(levels) <= max(levels) <= DEEPEST:
        raise UserError("law", f"closes what is not open, or nests more than {DEEPEST} parentheses", _REMEDY)
    python = re.sub(r"\s", " ", text).replace("^", "**")
    try:
        return _law(ast.parse(f"({python})", mode="eval").body)
    except SyntaxError as error:
        before = python[: max((error.offset or 0) - 2, 0)]
        raise UserError(f"column {len(before) - before.count('**') + 1}", error.msg, _REMEDY) from None


def _refused(node: ast.expr, problem: str, remedy: str = _REMEDY) -> UserError:
    return UserError(f"'{_text(node)}'", problem, remedy)


def _text(node: ast.expr) -> str:
    return ast.unparse(node).replace(" ** ", "^")


def _law(node: ast.expr) -> law.Law:
    """The law of an expression. Raises `UserError` for an expression that is no law."""
    if (number := _literal(node)) is not None:
        return number
    match node:
        case ast.Name(name) if name == COEFFICIENT:
            return law.Coefficient()
        case ast.Name(name) if name in VARIABLES:
            return law.Quantity(VARIABLES[name])
        case ast.Call(ast.Name(name), [_, *_] as arguments, []) if name in _FUNCTIONS:
            return _call(node, name, arguments)
        case ast.Name(name) | ast.Call(ast.Name(name)):
            meant = did_you_mean(name, (*VARIABLES, *_FUNCTIONS, COEFFICIENT))
            names = f"variables: {', '.join(VARIABLES)}; functions: {', '.join(_FUNCTIONS)}; c: the coefficient"
            raise _refused(node, f"unknown name '{name}'", meant + names)
        case ast.UnaryOp(ast.USub(), operand):
            return law.Call(Operation.NEGATE, (_law(operand),))
        case ast.BinOp(base, ast.Pow(), power):
            exponent = _number(power, "an exponent")
            if exponent.unit:
                raise _refused(power, "an exponent has no unit")
            return law.Call(Operation.POWER, (_law(base), exponent))
        case ast.BinOp(left, operator, right) | ast.Compare(left, [operator], [right]):
            if (operation := _OPERATIONS.get(type(operator))) is not None:
                return law.Call(operation, (_law(left), _law(right)))
    raise _refused(node, "is in no law")


def _literal(node: ast.expr) -> law.Number | None:
    """The number of a node, with its unit and its sign; None for any other node."""
    match node:
        case ast.UnaryOp(ast.USub(), (ast.Constant() | ast.Subscript()) as number) if (
            number.col_offset == node.col_offset + 1  # else it stands in parentheses
        ):
            value = _literal(number)
            return None if value is None else law.Number(-value.value, value.unit)
        case ast.Subscript(ast.Constant() as number, unit) if (value := _literal(number)) is not None:
            name = _text(unit).replace(" ", "")
            if unit_named(name) is None:
                units = f"units: {', '.join(UNIT_NAMES)}, multiplied by *, divided by /, raised by ^"
                raise _refused(node, f"unknown unit '{name}'", did_you_mean(name, UNIT_NAMES) + units)
            return law.Number(value.value, name)
        case ast.Constant(int() | float() as stated) if not isinstance(stated, bool):
            if abs(stated) > LARGEST:
                raise _refused(node, "is too large", "give a smaller number")
            return law.Number(float(stated))
    return None


def _number(node: ast.expr, meaning: str) -> law.Number:
    if (number := _literal(node)) is None:
        raise _refused(node, f"is not {meaning}", "give a number")
    return number


def _call(node: ast.expr, name: str, arguments: Sequence[ast.expr]) -> law.Law:
    needed = _ARGUMENTS.get(name, 1)
    if name != law.TABLE and len(arguments) != needed:
        raise _refused(node, f"has {len(arguments)} arguments", f"give {name}() {needed}")
    first, further = _law(arguments[0]), arguments[1:]
    if name == law.LAGGED:
        return law.Lag(first, _positive(further[0], "the time of a lag", "ms"))
    if name == law.RINGING:
        frequency = _positive(further[0], "the frequency of a resonance", "kHz")
        damping = _positive(further[1], "the damping of a resonance", "-")
        if damping >= 1.0:
            raise _refused(further[1], "nothing rings", "give a damping below 1")
        return law.Resonance(first, frequency, damping)
    if name != law.TABLE:
        return law.Call(law.FUNCTIONS[name], (first, *map(_law, further)))
    numbers = [_number(one, "a point or a value of a table") for one in further]
    points, values = tuple(numbers[::2]), tuple(numbers[1::2])
    if len(values) < 2 or len(points) != len(values):
        raise _refused(node, "is too short", "give a point and a value of it, two times or more")
    if any(number.reckoned >= other.reckoned for number, other in pairwise(points)):
        raise _refused(node, "its points do not rise", "put them in order")
    return law.LawTable(first, points, values)


def _positive(node: ast.expr, meaning: str, unit: str) -> float:
    """The number above 0 that a node states, in a unit. Raises `UserError` for any other node."""
    number = _number(node, meaning)
    named, wanted = unit_named(number.unit or unit), unit_named(unit)
    if not number.value > 0.0 or named is None or wanted is None or named[1] != wanted[1]:
        raise _refused(node, f"is not {meaning}", f"give it in {unit}, above 0")
    return number.value * named[0] / wanted[0]


class FormNumber(NamedTuple):
    """A number within a law, and the bounds between which it may be fitted."""

    value: float
    lowest: float
    highest: float

    def settled(self, value: float) -> "FormNumber":
        """The number with another value, rounded to EXACT_DIGITS of its range."""
        decimals = EXACT_DIGITS - math.floor(math.log10(self.highest - self.lowest))
        return self._replace(value=round(value, decimals) + 0.0)


@lru_cache(maxsize=4096)
def law_of(form: str, numbers: tuple[float, ...]) -> Law:
    """The law of a form times `c`; numbers to 8 digits, negative ones in parentheses unless they are arguments."""
    texts = {letter: f"{number:.8g}" for letter, number in zip(LETTERS, numbers, strict=False)}

    def number_text(match: re.Match[str]) -> str:
        before, text = match[1] or "", texts[match[2]]
        return before + text if before or not text.startswith("-") else f"({text})"

    return parse(f"c*({_NUMBER.sub(number_text, form)})")
