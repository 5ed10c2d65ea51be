"""Cells of a CSV line: how a line falls into them, which are numbers."""

import csv
from collections.abc import Sequence

NO_NUMBER = ("1.#ind", "-1.#ind", "1.#qnan", "-1.#qnan")  # as Windows prints it
MISSING = frozenset(
    ("", "nan", "-nan", "na", "n/a", "<na>", "#n/a", "#na", "null", "none", "-", "--", "---", *NO_NUMBER)
)
"""In lower case."""


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number with this decimal sign, or one of the ways to say that there is none."""
    text = cell.strip()
    if is_missing(text):
        return True
    if decimal != "." and "." in text:
        return False
    try:
        float(cell.replace(decimal, "."))  # not of the text: a control character beside a number is damage
    except ValueError:
        return False
    return "_" not in text


def is_missing(cell: str) -> bool:
    """Whether a cell says that there is no value."""
    return cell.strip().lower() in MISSING


def split_line(line: str, separator: str) -> list[str]:
    """Cells of a line without its end."""
    if separator == " ":
        return line.split()
    if '"' not in line:
        return line.split(separator)
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return line.split(separator)


def decimal_of(rows: Sequence[Sequence[str]], places: Sequence[int]) -> str:
    """A comma where more numbers have commas than points."""
    cells = [row[place] for row in rows for place in places if place < len(row)]
    with_comma = sum("," in cell and is_number(cell, ",") for cell in cells)
    with_point = sum("." in cell and is_number(cell, ".") for cell in cells)
    return "," if with_comma > with_point else "."
