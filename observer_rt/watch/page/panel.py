"""A panel of the page: axes by Bokeh, and over them what the browser draws by itself, of the columns it is sent."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

from bokeh.models import Range1d
from bokeh.plotting import figure

from observer_rt.watch.injection import SeenInjection, Signal
from observer_rt.watch.page.limits import Limits

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
