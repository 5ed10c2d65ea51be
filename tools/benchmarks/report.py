"""What a bench shows of its results: tables and lines on a screen or a JSON document, figures beside their bars."""

import json
import math
import string
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from rich.console import Console
from rich.table import Table
from scipy.stats import binomtest

from tests.plants.arrays import Array

TABLE_WIDTH = 210  # where stdout is no terminal
NOTHING = "-"  # in the place of a figure of which there is none
CONFIDENCE = 0.99
Shown = Table | str
Row = TypeVar("Row")
Columns = Mapping[str, str | Callable[[Row], str]]
"""Cells by their headings: templates of what a row has, as `{.seconds:.1f}` or `{[share]!p:.0f}`, or what makes them.

`!p` is in per cent; of None a template makes `NOTHING`.
"""


class _Templates(string.Formatter):
    def get_value(self, key: int | str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        return args[0]

    def convert_field(self, value: Any, conversion: str | None) -> Any:
        if conversion == "p":
            return None if value is None else 100.0 * value
        return super().convert_field(value, conversion)

    def format_field(self, value: Any, format_spec: str) -> str:
        return NOTHING if value is None else str(super().format_field(value, format_spec))


_templates = _Templates()


def put_out(as_json: bool, document: Any, shown: Iterable[Shown], width: int = TABLE_WIDTH) -> None:
    """The document as JSON on stdout, or tables and lines on a screen."""
    if as_json:
        print(json.dumps(finite(document), indent=2))
        return
    console = Console()
    if not console.is_terminal:
        console = Console(width=width)
    for part in shown:
        console.print(part, highlight=False, markup=False)


def ruled(title: str, names: Sequence[str], numbers: Sequence[str], no_wrap: bool = False) -> Table:
    """A table with columns of names, which do not wrap, and of numbers, which may."""
    table = Table(title=title, title_justify="left")
    for heading in names:
        table.add_column(heading, no_wrap=True)
    for heading in numbers:
        table.add_column(heading, justify="right", no_wrap=no_wrap)
    return table


def cells(row: Row, columns: Columns[Row]) -> list[str]:
    """Of one row."""
    return [_templates.vformat(c, [row], {}) if isinstance(c, str) else c(row) for c in columns.values()]


def table_of(
    title: str, name: str, rows: Mapping[str, Row], columns: Columns[Row], no_wrap: bool = False
) -> Table:
    """A row for each name, under the heading `name`, with its cells."""
    table = ruled(title, (name,), tuple(columns), no_wrap)
    for each, row in rows.items():
        table.add_row(each, *cells(row, columns))
    return table


def list_of(title: str, groups: Iterable[Iterable[Row]], columns: Columns[Row], names: int = 1) -> Table:
    """Rows, a line between groups of them; names: how many of the columns are of names."""
    headings = tuple(columns)
    table = ruled(title, headings[:names], headings[names:])
    for group in groups:
        for row in group:
            table.add_row(*cells(row, columns))
        table.add_section()
    return table


def frame_table(title: str, frame: pd.DataFrame) -> Table:
    """A row for each of a frame's, under its index's name; figures with four digits."""
    table = ruled(title, (str(frame.index.name or ""),), tuple(map(str, frame.columns)))
    for name, row in frame.iterrows():
        table.add_row(str(name), *(NOTHING if pd.isna(value) else f"{value:.4g}" for value in row))
    return table


def crash_lines(crashes: Iterable[str]) -> Iterator[str]:
    """What is said of cases that crashed."""
    yield from (f"crash: {line}" for line in crashes)


def finite(value: Any) -> Any:
    """The same with None in the place of what is no finite number, which JSON does not know."""
    if isinstance(value, dict):
        return {key: finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def known(values: Iterable[Row | None]) -> list[Row]:
    """Those that are not None."""
    return [value for value in values if value is not None]


Numbers = Sequence[float] | Array


def mean(values: Numbers) -> float | None:
    """Also the share of flags that hold; None without any."""
    return float(np.mean(values)) if len(values) else None


def median(values: Numbers) -> Any:
    """A float; None without any."""
    return percentile(values, 50)


def percentile(values: Numbers, share: float) -> Any:
    """A float, share in %; None without any."""
    return float(np.percentile(values, share)) if len(values) else None


def clopper_pearson(successes: int, trials: int) -> tuple[float, float]:
    """99 % interval of a probability from its count of successes."""
    interval = binomtest(successes, trials).proportion_ci(CONFIDENCE)
    return float(interval.low), float(interval.high)


@dataclass(frozen=True)
class Figure:
    """A figure under the name it has in the JSON document. at_least or at_most: its bar, None where there is none."""

    name: str
    value: float | None
    peer: str = ""
    at_most: float | None = None
    at_least: float | None = None

    @property
    def is_met(self) -> bool | None:
        """Whether it meets its bar; None without one, or where nothing was measured."""
        if self.value is None or (self.at_most is None and self.at_least is None):
            return None
        low = self.at_least is None or self.value >= self.at_least
        return low and (self.at_most is None or self.value <= self.at_most)

    @property
    def bar(self) -> str:
        """The bar as text."""
        if self.at_most is not None:
            return f"<= {self.at_most:g}"
        return f">= {self.at_least:g}" if self.at_least is not None else ""


def figures_table(figures: Sequence[Figure], title: str, load: tuple[float, float] | None = None) -> Table:
    """Figures with their verdicts; load: of the machine, before and after."""
    if load is not None:
        title += f" (load {load[0]:.1f} before, {load[1]:.1f} after)"
    verdicts = {None: "", True: "met", False: "MISSED"}
    columns: Columns[Figure] = {
        "figure": "{.name}",
        "value": "{.value:.4g}",
        "bar": "{.bar}",
        "": lambda each: verdicts[each.is_met],
        "against": "{.peer}",
    }
    return list_of(title, [figures], columns, names=len(columns))
