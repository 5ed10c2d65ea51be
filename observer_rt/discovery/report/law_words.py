"""A term in the words of an engineer: what is as if more or less, by how much, and where or when."""

import re
from collections.abc import Mapping

from observer_rt.discovery.search.curves import AXES
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation

_AS_IF: Mapping[TermEquation, tuple[str, str, str]] = {
    TermEquation.LINE_FLOW: ("the line lost more pressure, by", "the line lost {} less", "the line lost {} more"),
    TermEquation.LINE_PRESSURE: (
        "fuel left the line beside the nozzle,", "{} came into the line's end", "{} left the line beside the nozzle",
    ),
    TermEquation.SEAT_FLOW: (
        "the flow through the seat were larger by a share of",
        "the seat let {} less through", "the seat let {} more through",
    ),
    TermEquation.NOZZLE_FLOW: (
        "the flow through the nozzle were larger by a share of",
        "the nozzle lost {} of its flow", "the nozzle let {} more through",
    ),
    TermEquation.STIFFNESS: (
        "the fuel in the line were stiffer by a share of",
        "the fuel in the line were softer by {}", "the fuel in the line were stiffer by {}",
    ),
    TermEquation.INERTANCE: (
        "the inertance of the line were larger by a share of",
        "the line's inertance were {} less", "the line's inertance were {} more",
    ),
    TermEquation.CHAMBER_PRESSURE: (
        "the pressure in the chamber were higher by",
        "the pressure in the chamber were {} lower", "the pressure in the chamber were {} higher",
    ),
    TermEquation.LINE_PRESSURE_SENSOR: (
        "the line-pressure sensor read more, by",
        "the line-pressure sensor read {} less", "the line-pressure sensor read {} more",
    ),
    TermEquation.NEEDLE_LIFT: (
        "the needle stood higher than measured, by",
        "the needle stood {} lower than measured", "the needle stood {} higher than measured",
    ),
    TermEquation.RAIL_PRESSURE: (
        "the rail pressure were higher than measured, by",
        "the rail pressure were {} lower than measured", "the rail pressure were {} higher than measured",
    ),
}  # fmt: skip
"""By equation: of any law, and of a simple one with a negative coefficient and a positive one."""
_SIGNS = {"mm3/ms": "mm³/ms"}
_AXIS_OF = {str(parse(axis.over)): axis for axis in AXES}
_NUMBER = r"(-?[\d.]+(?:e[-+]?\d+)?)"
_OVER = "(" + "|".join(map(re.escape, _AXIS_OF)) + ")"
_SINCE = r"\(?time_since_opening / 1\)?"
_WORDS = tuple(
    (re.compile(rf"c \* \(?{pattern}\)?"), words)
    for pattern, words in {
        "1": "all the time",
        r"\(1 \+ tanh\(\(" + _OVER + rf" - {_NUMBER}\) / {_NUMBER}\)\) / 2": "from {0} on",
        r"exp\(-\(\(" + _OVER + rf" - {_NUMBER}\) / {_NUMBER}\)\^2": "round {0}",
        rf"exp\(-{_SINCE} / {_NUMBER}": "at every opening, fading in {0} ms",
        rf"exp\(-{_SINCE} / {_NUMBER}\) \* sin\(6\.283185307 \* {_NUMBER} \* {_SINCE} \+ {_NUMBER}\)": (
            "at most, ringing at {1} kHz after every opening for {0} ms"
        ),
        rf"sin\(6\.283185307 \* {_NUMBER}\[Hz\] \* time \+ {_NUMBER}": "and back, a wave of {0} Hz",
        rf"injection_number > {_NUMBER}": "from the injection after number {0} on",
        rf"\(?injection_number - 1\)? / {_NUMBER}": "in the end, growing from injection to injection",
        rf"time / {_NUMBER}": "in the end, growing for {0} s",
        "open": "while the needle is open",
        "closed": "while the needle is shut",
        "opening": "while the needle opens",
        "closing": "while the needle closes",
    }.items()
)


def as_if(term: Term, sized: str) -> str:
    """What it is as if. sized: its law with its coefficient."""
    plain = _plain_words(term)
    return f"{plain}: {term.equation} = {sized}" if plain else f"{_AS_IF[term.equation][0]} {sized}"


def _plain_words(term: Term) -> str:
    """Such as `the nozzle lost 21 % of its flow from a time since the opening of 0.605 ms on`.

    Empty where the law is not so simple.
    """
    matches = ((pattern.fullmatch(str(term.law)), words) for pattern, words in _WORDS)
    found, words = next(((found, words) for found, words in matches if found), (None, ""))
    if found is None:
        return ""
    numbers = list(found.groups())
    if numbers and numbers[0] in _AXIS_OF:
        axis = _AXIS_OF[numbers[0]]
        value = f"{axis.offset + axis.scale * float(numbers[1]):.3g}"
        numbers = [f"a {axis.words} of {value}{'' if axis.unit == '-' else f' {axis.unit}'}"]
    size = abs(term.coefficient)
    unit = str(term.equation.unit)
    amount = f"{100.0 * size:.3g} %" if term.equation.is_share else f"{size:.3g} {_SIGNS.get(unit, unit)}"
    return f"{_AS_IF[term.equation][1 + (term.coefficient > 0.0)].format(amount)} {words.format(*numbers)}"
