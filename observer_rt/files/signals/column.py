"""Columns in memory: what every reader of whole files gives, and DataFrames and arrays; a preview of the others."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, TypeAdapter

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.sandbox import WorkerError, checked

Values = NDArray[np.float64]
NANOSECONDS = 1e9  # a second
_UNIT = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))$")
_NOT_A_TIME = np.iinfo(np.int64).min


@dataclass(frozen=True, eq=False)
class Column:
    """A column of a file, or a channel: values (n,) of whatever type they have there.

    unit: empty where none is stated; time: own stamps [s] (n,), None: those of a column, or none; group: number of
    the channel's group, where several have its name.
    """

    name: str
    values: NDArray[Any]
    unit: str = ""
    time: Values | None = None
    group: int | None = None

    @property
    def is_calendar(self) -> bool:
        """Whether it holds moments or times that have a unit of their own."""
        return self.values.dtype.kind in "mM"

    @property
    def is_text(self) -> bool:
        """Whether it holds cells that are not numbers by type."""
        return self.values.dtype.kind in "OUS"

    @property
    def cells(self) -> list[str]:
        """Values as text, empty where there is none."""
        return ["" if cell is None else str(cell) for cell in self.values]


_ANSWER = TypeAdapter(
    tuple[str, np.ndarray | list[str], str, np.ndarray | None, int | None],
    config=ConfigDict(arbitrary_types_allowed=True),
)


def column_of(answer: Any) -> Column:
    """A column from the fields that a reader apart gave, text as a list. Raises `WorkerError` for anything else."""
    name, values, unit, time, group = checked(_ANSWER, answer)
    if isinstance(values, list):
        values = np.array(values, object)
    if values.ndim != 1 or (time is not None and (time.dtype != np.float64 or time.shape != values.shape)):
        raise WorkerError("its reader gave a column without one time for each value")
    return Column(name, values, unit, time, group)


def columns_of(table: Any) -> tuple[Column, ...]:
    """Columns of a pandas DataFrame, with an index of floats or moments as the first, or of arrays by name.

    Units: of names as `p_Rail [bar]`, or `attrs["unit"]` of a Series. Raises `UserError` for what is neither.
    """
    if hasattr(table, "columns") and hasattr(table, "index"):
        held = {name: table[name] for name in table.columns}
        if len(held) != len(table.columns):
            raise UserError("table", "several of its columns have one name", "give each a name of its own")
        if table.index.dtype.kind in "fmM":
            held = {table.index.name or "time": table.index, **held}
    elif isinstance(table, Mapping):
        held = dict(table)
    else:
        raise UserError(
            "table", f"is a {type(table).__name__}", "give a pandas DataFrame, or arrays by name in a dict"
        )
    found = []
    for heading, values in held.items():
        name, unit = name_and_unit(str(heading))
        stated = getattr(values, "attrs", {}).get("unit", unit)
        found.append(Column(name, _array(values, name), str(stated)))
    return tuple(found)


def name_and_unit(cell: str) -> tuple[str, str]:
    """`p_Rail [bar]` as both."""
    found = _UNIT.match(cell)
    if found is None or not found["name"]:
        return cell, ""
    return found["name"], (found["square"] if found["square"] is not None else found["round"]).strip()


def _array(values: Any, name: str) -> NDArray[Any]:
    if getattr(getattr(values, "dtype", None), "tz", None) is not None:
        values = values.tz_convert(None) if hasattr(values, "tz_convert") else values.dt.tz_convert(None)
    array = np.asarray(values)
    if array.ndim != 1:
        raise UserError(
            f"table, {name}", f"has the shape {array.shape}", "give one value for each sample: shape (n,)"
        )
    return array


def moments_as_seconds(values: NDArray[Any]) -> Values:
    """Moments or times (n,) in seconds from the first one that is there; NaN where there is none."""
    nanoseconds = values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64)
    there = nanoseconds != _NOT_A_TIME
    origin = nanoseconds[there][0] if there.any() else 0
    return np.where(there, (nanoseconds - origin) / NANOSECONDS, np.nan)
