"""Figures: colours and settings, files of them, and SVG to stand in a page."""

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from observer_rt.foundation.errors import file_errors
from observer_rt.foundation.files import replacing

MEASURED, GIVEN, FOUND = "#1b1f24", "#c0392b", "#1f77b4"
"""Colours of what was measured, of the model as given, and of the one that was found."""
LOOK = {
    "font.size": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#59636e",
    "axes.labelcolor": "#1b1f24",
    "xtick.color": "#59636e",
    "ytick.color": "#59636e",
    "axes.grid": True,
    "grid.color": "#e3e7eb",
    "axes.axisbelow": True,
}
_SVG = {"svg.fonttype": "none", "svg.hashsalt": "observer_rt", "path.simplify_threshold": 0.3}
_SHOWN_DPI = 80
_NO_METADATA = dict.fromkeys(("Date", "Creator", "Type", "Format"))


class NotebookFigure(Figure):
    """A figure that notebooks show, whether or not pyplot is in use."""

    def _repr_png_(self) -> bytes:
        picture = io.BytesIO()
        self.savefig(picture, format="png", dpi=_SHOWN_DPI)
        return picture.getvalue()


@contextmanager
def svg_figure(width: float, height: float) -> Iterator[tuple[Figure, Callable[[], str]]]:
    """A figure to draw on, inches, and what makes an <svg> element of it."""
    settings = {**LOOK, **_SVG}
    with mpl.rc_context(settings):
        figure = Figure(figsize=(width, height), layout="constrained")

        def svg() -> str:
            text = io.StringIO()
            with mpl.rc_context(settings):
                figure.savefig(text, format="svg", metadata=_NO_METADATA)
            return text.getvalue()[text.getvalue().index("<svg") :]

        yield figure, svg


def save_figure(figure: Figure, path: Path, dpi: int) -> None:
    """Write a figure in the format of the suffix. Raises `UserError`, `RunError`."""
    with file_errors(path), replacing(path) as part:
        figure.savefig(part, dpi=dpi)
