"""A panel of the page: axes by Bokeh whose ends stay as long as they can, and columns the browser draws itself."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

import numpy as np
from bokeh.models import Range1d
from bokeh.plotting import figure

from observer_rt.watch.results import SeenInjection, Signal

Limits: TypeAlias = tuple[float, float]
_WIDEST = 3.0  # times what is to be seen


class Axis:
    """Of some columns; at least `span` long, so that noise looks like noise.

    margin: beside what is to be seen, as a share of it.
    """

    def __init__(self, columns: Sequence[str], span: float, margin: float = 0.04) -> None:
        self._columns = columns
        self._span = span
        self._margin = margin
        self._limits: Limits = (0.0, span)

    def limits(self, columns: Mapping[str, Signal]) -> Limits:
        """Its ends for what is to be seen: those it has where they will do, else round ones."""
        found = np.concatenate([columns[name] for name in self._columns])
        found = found[np.isfinite(found)]
        if found.size:
            low, high = float(found.min()), float(found.max())
            beside = self._margin * (high - low)
            self._limits = round_limits(low - beside, high + beside, self._span, self._limits)
        return self._limits


def round_limits(low: float, high: float, span: float, before: Limits) -> Limits:
    """Round ends around values from low to high, at least `span` apart; those before where they are not too wide."""
    needed = max(high - low, span)
    if before[0] <= low and high <= before[1] and span <= before[1] - before[0] <= _WIDEST * needed:
        return before
    step = 10.0 ** math.floor(math.log10(needed)) / 2.0
    middle = 0.5 * (low + high)
    first = math.floor(min(low, middle - 0.5 * span) / step)
    last = math.ceil(max(high, middle + 0.5 * span) / step)
    return first * step, last * step


Columns: TypeAlias = Mapping[str, Signal]
Scale: TypeAlias = Callable[[Columns], Limits]
"""The ends of an axis for what is to be seen."""
_TEXT = "17px"  # to be read from two metres


class MarkKind(StrEnum):
    """How a mark is drawn: the pens of page.js."""

    LINE = "line"
    BAND = "band"
    BARS = "bars"
    DASHES = "dashes"
    DOTS = "dots"


@dataclass(frozen=True)
class Mark:
    """Columns that are drawn one way; y: of a band or bars low and high; width, dash [px]; label: in the legend."""

    kind: MarkKind
    x: str
    y: tuple[str, ...]
    colour: str
    width: float = 1.0
    dash: tuple[int, ...] = ()
    alpha: float = 1.0
    label: str = ""


@dataclass(frozen=True)
class PanelPart:
    """What a panel shows: the ends of its axes and the columns of its marks."""

    x: Limits
    y: Limits
    columns: Columns


@dataclass(frozen=True)
class Axes:
    """Words, height [px] and axes of a panel."""

    title: str
    x_label: str
    y_label: str
    x: Scale
    y: Scale
    height: int = 226


class Panel:
    """Some injections by some marks."""

    def __init__(
        self,
        name: str,
        axes: Axes,
        marks: Sequence[Mark],
        columns: Callable[[Sequence[SeenInjection]], Columns],
    ) -> None:
        """columns: of injections, the last of them as the one that counts; none: there is nothing to draw."""
        self.name = name
        self.title = axes.title
        self.figure = _figure(name, axes)
        self._axes = axes
        self.marks = tuple(marks)
        self._columns = columns

    @property
    def legend(self) -> list[Mark]:
        """What is to be told of."""
        return [mark for mark in self.marks if mark.label]

    def part(self, injections: Sequence[SeenInjection]) -> dict[str, PanelPart]:
        """What is to be drawn of some injections, by the panel's name."""
        columns = self._columns(injections)
        if not columns:
            return {}
        return {self.name: PanelPart(self._axes.x(columns), self._axes.y(columns), columns)}


def _figure(name: str, axes: Axes) -> figure:
    """As wide as its place, without tools: a bench monitor has no mouse."""
    made = figure(
        name=name,
        height=axes.height,
        sizing_mode="stretch_width",
        toolbar_location=None,
        tools="",
        x_axis_label=axes.x_label,
        y_axis_label=axes.y_label,
        x_range=Range1d(),
        y_range=Range1d(),
        min_border_right=14,
    )
    for axis in (made.xaxis, made.yaxis):
        axis.axis_label_text_font_size = _TEXT
        axis.axis_label_text_font_style = "normal"
        axis.major_label_text_font_size = _TEXT
    made.grid.grid_line_alpha = 0.5
    return made


OBSERVER, NOMINAL, PAST, BAND = "#0b4f9e", "#d9730d", "#7f9fc4", "#9dc1ea"
SECOND, THIRD = "#188038", "#8e24aa"
NOT_VALID = "#b3261e"
