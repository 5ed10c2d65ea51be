"""Units of tables: the end of a column's name says its unit, `DataFrame.attrs["si"]` the factor to SI."""

from collections.abc import Iterable
from typing import NamedTuple

import pandas as pd

from observer_rt.foundation.units import (
    CUBIC_MILLIMETRE,
    MEGAPASCAL,
    MICROMETRE,
    MICROSECOND,
    MILLIGRAM,
    MILLIMETRE,
    MM3_PER_MS,
)

SI = "si"


class ColumnUnit(NamedTuple):
    """Unit of a column: value_si = value * factor."""

    name: str
    si: str
    factor: float


_UNITS = {
    "mm3_per_ms": ColumnUnit("mm3/ms", "m3/s", MM3_PER_MS),
    "MPa": ColumnUnit("MPa", "Pa", MEGAPASCAL),
    "mg": ColumnUnit("mg", "kg", MILLIGRAM),
    "mm3": ColumnUnit("mm3", "m3", CUBIC_MILLIMETRE),
    "mm": ColumnUnit("mm", "m", MILLIMETRE),
    "um": ColumnUnit("um", "m", MICROMETRE),
    "us": ColumnUnit("us", "s", MICROSECOND),
    "Hz": ColumnUnit("Hz", "Hz", 1.0),
    "s": ColumnUnit("s", "s", 1.0),
}


def unit_of(column: str) -> ColumnUnit | None:
    """Unit that the end of a column's name says; None: a number, a word, or a temperature, which has an origin."""
    return _UNITS.get(_end_of(column))


def with_units(frame: pd.DataFrame) -> pd.DataFrame:
    """The table, its `attrs["si"]` with the `ColumnUnit` of every column that has one."""
    columns: Iterable[str] = frame.columns
    frame.attrs[SI] = {column: unit for column in columns if (unit := unit_of(column)) is not None}
    return frame


def in_si(frame: pd.DataFrame) -> pd.DataFrame:
    """Table of the same values in SI units.

    Parameters
    ----------
    frame : DataFrame
        Columns that end in their units, as all tables of the library.

    Returns
    -------
    DataFrame
        The same columns without units in their names.
    """
    result = {}
    for column in frame.columns:
        unit = unit_of(column)
        name = column if unit is None else column.removesuffix(f"_{_end_of(column)}")
        result[name] = frame[column] if unit is None else frame[column] * unit.factor
    return pd.DataFrame(result, index=frame.index)


def _end_of(column: str) -> str:
    """End of a column's name that is a unit; empty: it has none."""
    return next((end for end in _UNITS if column.endswith(f"_{end}")), "")
