"""The wear of all injectors as a page and as a picture."""

import io
from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.dates import date2num
from matplotlib.figure import Figure

from observer_rt import __version__
from observer_rt.fleet.trend import SURE, InjectorTrend
from observer_rt.foundation.file_errors import file_errors
from observer_rt.foundation.pages import templates_of

_COLOURS = {"nozzle": "#0b4f9e", "seat": "#188038"}
_SIDE_BY_SIDE = 3
_PAGES = templates_of(__package__)


def write_page(path: Path, found: Sequence[InjectorTrend], source: Path) -> None:
    """One self-contained HTML page."""
    pictures = [Markup(_svg(trend)) for trend in found]
    page = _PAGES.get_template("trend.html.j2").render(
        trends=list(zip(found, pictures, strict=True)), source=source, version=__version__, sure=SURE
    )
    with file_errors(path):
        path.write_text(page, encoding="utf-8")


def write_picture(path: Path, found: Sequence[InjectorTrend]) -> None:
    """All injectors in one picture; format by suffix."""
    columns = min(_SIDE_BY_SIDE, len(found))
    rows = -(-len(found) // columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(5.0 * columns, 3.2 * rows), sharey=True, squeeze=False, layout="constrained"
    )
    for number, place in enumerate(axes.flat):
        if number < len(found):
            _draw(place, found[number])
            place.set_title(found[number].injector)
        else:
            place.axis("off")
    with file_errors(path):
        figure.savefig(path, dpi=130)
    plt.close(figure)


def _svg(trend: InjectorTrend) -> str:
    figure = Figure(figsize=(9.0, 3.0), layout="constrained")
    _draw(figure.add_subplot(), trend)
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue().partition("<svg")[1] + text.getvalue().partition("<svg")[2]


def _draw(axes: Axes, trend: InjectorTrend) -> None:
    times = date2num(trend.times)
    axes.xaxis_date()
    for name, course in trend.courses.items():
        if not course.level.size:
            continue
        low, high = course.level - SURE * course.level_sigma, course.level + SURE * course.level_sigma
        axes.fill_between(times, 100.0 * low, 100.0 * high, color=_COLOURS[name], alpha=0.2, lw=0)
        axes.plot(times, 100.0 * course.level, color=_COLOURS[name], lw=2, label=name)
        axes.errorbar(
            times,
            100.0 * course.value,
            100.0 * SURE * course.sigma,
            fmt="o",
            ms=3,
            lw=0.8,
            color=_COLOURS[name],
            alpha=0.55,
        )
    axes.axhline(0.0, color="0.6", lw=0.8)
    axes.set_ylabel("change of flow, %")
    axes.tick_params(axis="x", labelrotation=20)
    if trend.times:
        axes.legend(loc="best", frameon=False)
    else:
        axes.text(0.5, 0.5, "no valid injection", transform=axes.transAxes, ha="center")
