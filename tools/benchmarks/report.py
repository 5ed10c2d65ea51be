"""What a bench shows of its results: tables and lines on a screen or a JSON document, figures beside their bars."""

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.stats import beta

TABLE_WIDTH = 210  # where stdout is no terminal
NOTHING = "-"  # in the place of a figure of which there is none
CONFIDENCE = 0.99
Shown = Table | str
Row = TypeVar("Row")
Columns = Mapping[str, Callable[[Row], str]]
"""Cells by their headings."""


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


def table_of(title: str, name: str, rows: Mapping[str, Row], columns: Columns[Row]) -> Table:
    """A row for each name, under the heading `name`, with its cells."""
    table = ruled(title, (name,), tuple(columns))
    for each, row in rows.items():
        table.add_row(each, *(cell(row) for cell in columns.values()))
    return table


def finite(value: Any) -> Any:
    """The same with None in the place of what is no finite number, which JSON does not know."""
    if isinstance(value, dict):
        return {key: finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def mean(values: Sequence[float]) -> float | None:
    """Also the share of flags that hold; None without any."""
    return float(np.mean(values)) if values else None


def median(values: Sequence[float]) -> float | None:
    """None without any."""
    return float(np.median(values)) if values else None


def percentile(values: Sequence[float], share: float) -> Any:
    """A float, share in %; None without any."""
    return float(np.percentile(values, share)) if values else None


def clopper_pearson(successes: int, trials: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Interval of a probability from its count of successes."""
    tail = 0.5 * (1.0 - confidence)
    low = beta.ppf(tail, successes, trials - successes + 1) if successes > 0 else 0.0
    high = beta.ppf(1.0 - tail, successes + 1, trials - successes) if successes < trials else 1.0
    return float(low), float(high)


@dataclass(frozen=True)
class Figure:
    """A figure under the name it has in the JSON document. at_least or at_most: its bar, None where there is none."""

    name: str
    value: float | None
    peer: str
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
    table = Table("figure", "value", "bar", "", "against", title=title, title_justify="left")
    for each in figures:
        value = NOTHING if each.value is None else f"{each.value:.4g}"
        verdict = {None: "", True: "met", False: "MISSED"}[each.is_met]
        table.add_row(each.name, value, each.bar, verdict, each.peer)
    return table
