"""The language of laws, from text to tree; errors are reported with their column, and with what was expected there.

comparison = sum [(">" | "<") sum]
sum        = product {("+" | "-") product}
product    = signed {("*" | "/") signed}
signed     = "-" signed | power
power      = part ["^" ["-"] number]
part       = number ["[" unit "]"] | name | function "(" comparison {"," comparison} ")" | "(" comparison ")"
"""

import math
import re
from itertools import pairwise
from typing import NamedTuple, NoReturn

from observer_rt.foundation.errors import UserError, did_you_mean
from observer_rt.model.terms.law import (
    FUNCTIONS,
    LAGGED,
    PAIRS,
    RINGING,
    SIGNS,
    TABLE,
    Call,
    Coefficient,
    Lag,
    Law,
    LawTable,
    Number,
    Operation,
    Quantity,
    Resonance,
)
from observer_rt.model.terms.term import UNIT_NAMES, VARIABLES, unit_named

LONGEST = 300  # characters
DEEPEST = 30  # parentheses within parentheses
COEFFICIENT = "c"
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?:\s*\[(?P<unit>[^\]]*)\])?"
    r"|(?P<name>[A-Za-z_]\w*)|(?P<sign>[-+*/^(),<>])|(?P<end>$)|(?P<other>.))"
)
_FUNCTIONS = (*FUNCTIONS, LAGGED, RINGING, TABLE)
_ALL_NAMES = (*VARIABLES, *_FUNCTIONS, COEFFICIENT)


class _Token(NamedTuple):
    kind: str
    text: str
    column: int
    unit: str = ""


def parse(text: str) -> Law:
    """The law a text states. Raises `UserError` naming the column, the error and what was expected."""
    if len(text) > LONGEST:
        raise UserError(
            f"column {LONGEST}", f"the law is longer than {LONGEST} characters", "make it shorter"
        )
    parser = _Parser(text)
    law = parser.comparison()
    if parser.token.kind != "end":
        parser.refuse("an operator (+ - * / ^ > <) or the end")
    return law


class _Parser:
    def __init__(self, text: str) -> None:
        self._text, self._position, self._depth = text, 0, 0
        self.token = self._next()

    def refuse(self, expected: str) -> NoReturn:
        """Raise `UserError` for the token at hand."""
        actual = "the law ends" if self.token.kind == "end" else f"found '{self.token.text}'"
        raise UserError(f"column {self.token.column}", f"{actual}, expected {expected}", "correct the law")

    def comparison(self) -> Law:
        """Parse a comparison and all that binds tighter. Raises `UserError` for one nested too deep or no law."""
        self._depth += 1
        if self._depth > DEEPEST:
            raise UserError(
                f"column {self.token.column}", f"more than {DEEPEST} nested parentheses", "make it simpler"
            )
        law = self._sum()
        if sign := self._taken("<", ">"):
            law = Call(SIGNS[sign], (law, self._sum()))
            if self.token.text in ("<", ">"):
                self.refuse("no second comparison: put one in parentheses")
        self._depth -= 1
        return law

    def _sum(self) -> Law:
        law = self._product()
        while sign := self._taken("+", "-"):
            law = Call(SIGNS[sign], (law, self._product()))
        return law

    def _product(self) -> Law:
        law = self._signed()
        while sign := self._taken("*", "/"):
            law = Call(SIGNS[sign], (law, self._signed()))
        return law

    def _signed(self) -> Law:
        minuses = 0
        while self._taken("-"):
            minuses += 1
        is_number = self.token.kind == "number"
        law = self._power()
        if minuses and is_number and isinstance(law, Number):
            law, minuses = Number(-law.value, law.unit), minuses - 1
        for _ in range(minuses):
            law = Call(Operation.NEGATE, (law,))
        return law

    def _power(self) -> Law:
        law = self._part()
        if self._taken("^"):
            sign = -1.0 if self._taken("-") else 1.0
            exponent = self._number("a number as exponent")
            if exponent.unit:
                self.refuse("an exponent without a unit")
            law = Call(Operation.POWER, (law, Number(sign * exponent.value)))
            if self.token.text == "^":
                self.refuse("no second exponent: put the power in parentheses")
        return law

    def _part(self) -> Law:
        if self.token.kind == "number":
            return self._number("")
        if self.token.kind == "name":
            return self._named()
        if not self._taken("("):
            self.refuse("a number, a name or '('")
        law = self.comparison()
        self._demand(")")
        return law

    def _number(self, expected: str) -> Number:
        token = self.token
        if token.kind != "number":
            self.refuse(expected)
        value = float(token.text)
        if not math.isfinite(value):
            self.refuse("a smaller number")
        if token.unit and unit_named(token.unit) is None:
            raise UserError(
                f"column {token.column}",
                f"unknown unit '{token.unit}'",
                f"{did_you_mean(token.unit, UNIT_NAMES)}units: {', '.join(UNIT_NAMES)}, "
                "multiplied by *, divided by /, raised by ^",
            )
        self.token = self._next()
        return Number(value, token.unit)

    def _named(self) -> Law:
        token = self.token
        self.token = self._next()
        if token.text in _FUNCTIONS:
            return self._call(token)
        if token.text == COEFFICIENT:
            return Coefficient()
        if token.text not in VARIABLES:
            raise UserError(
                f"column {token.column}",
                f"unknown name '{token.text}'",
                f"{did_you_mean(token.text, _ALL_NAMES)}variables: {', '.join(VARIABLES)}; "
                f"functions: {', '.join(_FUNCTIONS)}; c is the coefficient",
            )
        return Quantity(VARIABLES[token.text])

    def _call(self, function: _Token) -> Law:
        self._demand("(")
        arguments = [self.comparison()]
        if function.text == LAGGED:
            law: Law = Lag(arguments[0], self._positive(function, "time of the lag", "ms"))
        elif function.text == RINGING:
            frequency = self._positive(function, "frequency", "kHz")
            damping = self._positive(function, "damping", "-")
            if damping >= 1.0:
                raise UserError(f"column {function.column}", "nothing rings", "give a damping below 1")
            law = Resonance(arguments[0], frequency, damping)
        elif function.text == TABLE:
            law = self._table(arguments[0])
        else:
            if FUNCTIONS[function.text] in PAIRS:
                self._demand(",")
                arguments.append(self.comparison())
            law = Call(FUNCTIONS[function.text], tuple(arguments))
        self._demand(")")
        return law

    def _positive(self, function: _Token, what: str, unit: str) -> float:
        """A further argument, a number above 0, in a unit."""
        self._demand(",")
        number = self._number(f"the {what} in {unit}, a number")
        named, wanted = unit_named(number.unit or unit), unit_named(unit)
        if not number.value > 0.0 or named is None or wanted is None or named[1] != wanted[1]:
            raise UserError(f"column {function.column}", f"no {what}", f"give it in {unit}, above 0")
        return number.value * named[0] / wanted[0]

    def _table(self, argument: Law) -> LawTable:
        """The points and values behind a table's argument."""
        numbers: list[Number] = []
        while self._taken(","):
            sign = -1.0 if self._taken("-") else 1.0
            number = self._number("a point or a value of the table, a number")
            numbers.append(Number(sign * number.value, number.unit))
        points, values = tuple(numbers[::2]), tuple(numbers[1::2])
        if len(values) < 2 or len(points) != len(values):
            self.refuse("a point and a value of it, two times or more")
        if any(number.reckoned >= other.reckoned for number, other in pairwise(points)):
            raise UserError(
                f"column {self.token.column}", "the points of the table do not rise", "put them in order"
            )
        return LawTable(argument, points, values)

    def _taken(self, *signs: str) -> str:
        """The sign at hand, where it is one of these; then it is behind us."""
        sign = self.token.text
        if self.token.kind != "sign" or sign not in signs:
            return ""
        self.token = self._next()
        return sign

    def _demand(self, sign: str) -> None:
        if not self._taken(sign):
            self.refuse(f"'{sign}'")

    def _next(self) -> _Token:
        match = _TOKEN.match(self._text, self._position)
        assert match is not None  # the last alternatives take anything
        kind = "number" if match["number"] else str(match.lastgroup)
        self._position = match.end()
        return _Token(kind, match[kind], match.start(kind) + 1, (match["unit"] or "").strip())
