"""Forms of laws: their text with letters in the places of the numbers that a fit may change."""

import math
import re
from functools import lru_cache
from typing import NamedTuple

from observer_rt.model.terms.law import Law
from observer_rt.model.terms.parser import parse

EXACT_DIGITS = 3  # of a number within a law, relative to its range
LETTERS = "AWFBCDEGIJKL"
"""Letters of the first number of a form, the second and so on, as `A` and `W` in `tanh((u - A)/W)`: first a position,
a width or frequency, and a phase. H, M and P are not among them, for units have them."""
_NUMBER = re.compile(rf"(, )?([{LETTERS}])")


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
