"""Numbers as text: what is one, what marks a missing one, which signs stand for decimals and between thousands."""

import re
from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

NO_NUMBER = ("1.#ind", "-1.#ind", "1.#qnan", "-1.#qnan")  # as Windows prints it
MISSING = frozenset(
    ("", "nan", "-nan", "na", "n/a", "<na>", "#n/a", "#na", "null", "none", "-", "--", "---", *NO_NUMBER)
)
"""Marks of a missing value, in lower case."""


_UNMISTAKABLE = "'\u2019 \u00a0\u202f"  # signs that are no decimal sign anywhere


def is_number(cell: str, decimal: str, thousands: str | None = None) -> bool:
    """Whether a cell is a number with these signs, or a mark for a missing one.

    thousands: None: any sign that a cell shows beyond doubt.
    """
    if is_missing(cell):
        return True
    try:
        number_of(cell, decimal, thousands)
    except ValueError:
        return False
    return True


def number_of(cell: str, decimal: str, thousands: str | None = None) -> float:
    """A cell as a number, signs as of `is_number`. Raises `ValueError` for what is none."""
    sign = thousands_of([cell], decimal) if thousands is None else thousands
    text = ungrouped(cell, sign)
    if "_" in text or (decimal != "." and "." in text):
        raise ValueError
    return float(text.replace(decimal, "."))  # not stripped: a control character beside a number is damage


def is_missing(cell: str) -> bool:
    """Whether a cell marks a missing value."""
    return cell.strip().lower() in MISSING


def decimal_of(rows: Sequence[Sequence[str]], places: Sequence[int]) -> str:
    """A comma where more numbers have commas for decimals than points."""
    cells = [row[place] for row in rows for place in places if place < len(row)]
    with_comma = sum("," in cell and is_number(cell, ",", "") for cell in cells)
    with_point = sum("." in cell and is_number(cell, ".", "") for cell in cells)
    both = [thousands_of([cell], ",") == "." for cell in cells if "." in cell and "," in cell]
    return "," if with_comma + sum(both) > with_point + len(both) - sum(both) else "."


def thousands_of(cells: Iterable[str], decimal: str) -> str:
    """Sign that separates thousands in some cell, beyond doubt; empty for none.

    A point or comma does only in a cell that has the decimal sign, too.
    """
    signs = [sign for sign in f".,{_UNMISTAKABLE}" if sign != decimal]
    for cell in cells:
        for sign in signs:
            is_clear = sign in cell and (sign in _UNMISTAKABLE or decimal in cell)
            if is_clear and _grouped(sign, decimal).fullmatch(cell.strip()):
                return sign
    return ""


def cells_as_numbers(cells: Sequence[str], decimal: str | None, thousands: str | None) -> NDArray[np.float64]:
    """Cells (n,) of one column as numbers, signs found out where they are None; NaN of a missing one.

    Raises `ValueError` with the row and the cell that is no number.
    """
    decimal = decimal or decimal_of([cells], range(len(cells)))
    sign = thousands or thousands_of(cells, decimal)
    found = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        if not is_missing(cell):
            try:
                found[row] = number_of(cell, decimal, sign)
            except ValueError:
                raise ValueError(row, cell) from None
    return found


def ungrouped(text: str, sign: str) -> str:
    """A text without the signs that stand before three digits and behind one; others stay, and make no number."""
    return _between(sign).sub("", text) if sign and sign in text else text


@cache
def _grouped(sign: str, decimal: str) -> re.Pattern[str]:
    end = rf"(?:{re.escape(decimal)}\d*)?(?:[eE][+-]?\d+)?"
    return re.compile(rf"[+-]?\d{{1,3}}(?:{re.escape(sign)}\d{{3}})+{end}")


@cache
def _between(sign: str) -> re.Pattern[str]:
    before = "|".join(
        rf"(?<={begin}{digits})" for begin in (r"\D", "^") for digits in (r"\d", r"\d\d", r"\d\d\d")
    )
    return re.compile(rf"(?:{before}){re.escape(sign)}(?=\d{{3}}(?!\d))", re.MULTILINE)
