"""Whole numbers with a separator of thousands, distinguished from numbers with three decimals.

`999` and `1.002` in one column are 999 and 1002, or 999 and 1.002. A writer of decimals leaves out zeros at their end
in one cell of ten, or writes all three everywhere; and it begins numbers below one with a zero.
"""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from observer_rt.files.signals.number_text import is_missing

ENOUGH = 60  # cells with three digits behind the sign, none of which ends so by chance


def may_be_thousandths(values: NDArray[np.float64]) -> bool:
    """Whether numbers (n,) as read could be whole ones with separators of thousands, at a quick look."""
    there = np.abs(values[np.isfinite(values)])
    whole = there == np.rint(there)
    broken = there[~whole]
    return bool(
        whole.any()
        and broken.size >= ENOUGH
        and there.max() < 1000.0
        and broken.min() > 1.0
        and (np.abs(1e3 * broken - np.rint(1e3 * broken)) < 1e-6).all()
    )


def first_thousands(cells: Sequence[str], decimal: str) -> int | None:
    """Row of the first cell with a separator of thousands that reads as the decimal sign; None: they are decimals."""
    grouped, plain = (
        re.compile(rf"[+-]?[1-9]\d{{0,2}}{re.escape(decimal)}\d{{3}}"),
        re.compile(r"[+-]?\d{1,3}"),
    )
    rows = [row for row, cell in enumerate(cells) if decimal in cell]
    others = [cell for cell in cells if decimal not in cell and not is_missing(cell)]
    if len(rows) < ENOUGH or not others:
        return None
    is_grouped = all(grouped.fullmatch(cells[row]) for row in rows) and all(map(plain.fullmatch, others))
    return rows[0] if is_grouped else None
