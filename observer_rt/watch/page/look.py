"""Colours and sizes of the page: to be read from two metres."""

from bokeh.models.annotations import Title
from bokeh.plotting import figure

OBSERVER, NOMINAL, PAST, BAND = "#0b4f9e", "#d9730d", "#7f9fc4", "#9dc1ea"
SECOND, THIRD = "#188038", "#8e24aa"
NOT_VALID = "#b3261e"
_TEXT = "17px"


def panel(title: str, x_label: str, y_label: str, height: int = 260) -> figure:
    """An empty figure as wide as its place, without tools: a bench monitor has no mouse."""
    made = figure(
        title=Title(text=title, text_font_size="20px"),
        height=height,
        sizing_mode="stretch_width",
        toolbar_location=None,
        tools="",
        x_axis_label=x_label,
        y_axis_label=y_label,
        min_border_right=14,
    )
    for axis in (made.xaxis, made.yaxis):
        axis.axis_label_text_font_size = _TEXT
        axis.axis_label_text_font_style = "normal"
        axis.major_label_text_font_size = _TEXT
    made.grid.grid_line_alpha = 0.5
    return made


def with_legend(made: figure) -> figure:
    """The figure with its legend in a line above, where it hides nothing."""
    legend = made.legend[0]
    legend.label_text_font_size = _TEXT
    legend.orientation = "horizontal"
    legend.border_line_alpha = 0.0
    legend.update(padding=0, spacing=16)
    made.add_layout(legend, "above")
    return made
