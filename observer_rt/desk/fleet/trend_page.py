"""The page of trends, which draws itself from its numbers, and their picture."""

import json
import math
import os
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.dates import date2num
from matplotlib.figure import Figure

from observer_rt.desk.fleet.course import SURE, Course, Signal
from observer_rt.desk.fleet.forecast import QUANTITIES
from observer_rt.desk.fleet.trend import InjectorTrend
from observer_rt.desk.fleet.trend_words import cells, headings
from observer_rt.foundation.figures import save_figure
from observer_rt.foundation.files import templates_of
from observer_rt.foundation.outputs import write_text

_COLOURS = {"nozzle": "#0b4f9e", "seat": "#188038"}
_SIDE_BY_SIDE, _MOST_DRAWN = 3, 24
_COLUMNS = 240  # of time in the picture of many
_PAGES = templates_of(__package__)


def write_page(path: Path, found: Sequence[InjectorTrend], source: Path) -> None:
    """One self-contained HTML page."""
    outlooks = found[0].outlooks if found else ()
    links = [
        [quote(os.path.relpath(file, path.absolute().parent)) for file in trend.files] for trend in found
    ]
    folder = _beginning([link for each in links for link in each])
    numbers = {
        "colours": scale_of(found),
        "scale": scale_of(found, 1.0, [each.limit.size for each in outlooks]),
        "limits": [[each.limit.name, 100.0 * each.limit.size] for each in outlooks],
        "folder": folder,
        "trends": [
            _numbers(trend, [link.removeprefix(folder) for link in its])
            for trend, its in zip(found, links, strict=True)
        ],
    }
    text = json.dumps(numbers, separators=(",", ":")).replace("<", "\\u003c")
    page = _PAGES.get_template("trend.html.j2").render(
        trends=found,
        headings=headings(found),
        cells=cells(found),
        limits=len(outlooks),
        numbers=Markup(text),  # no tag can begin in it
        source=source,
    )
    write_text(path, page)


def scale_of(found: Sequence[InjectorTrend], part: float = 0.995, limits: Sequence[float] = ()) -> int:
    """Change of flow [%] at the ends of the one scale of all injectors: a round one that holds this part of them."""
    levels = [np.abs(course.level) for trend in found for course in trend.courses.values()]
    held = float(np.quantile(np.concatenate(levels), part)) if sum(map(len, levels)) else 0.0
    return 10 * max(1, math.ceil(10.0 * max(held, *map(abs, limits), 0.0)))


def _numbers(trend: InjectorTrend, links: Sequence[str]) -> dict[str, Any]:
    """Minutes since 1970, links to the files, ages; value, its interval's half, level, its half [%]."""
    return {
        "name": trend.injector,
        "times": [round(each.timestamp() / 60.0) for each in trend.times],
        "files": links,
        "ages": [float(f"{each:.7g}") for each in trend.ages],
        **{name: [_rounded(each) for each in _drawn(course)] for name, course in trend.courses.items()},
    }


def _beginning(links: Sequence[str]) -> str:
    """What all links begin with."""
    alike = takewhile(lambda letters: len(set(letters)) == 1, zip(*links, strict=False))
    return "".join(letters[0] for letters in alike) if len(links) > 1 else ""


def _drawn(course: Course) -> tuple[Signal, Signal, Signal, Signal]:
    return course.value, SURE * course.sigma, course.level, SURE * course.level_sigma


def _rounded(values: Signal) -> list[float]:
    found: list[float] = np.round(100.0 * values, 2).tolist()
    return found


def write_picture(path: Path, found: Sequence[InjectorTrend]) -> None:
    """All injectors in one picture on one scale, many of them as a map; format by suffix."""
    save_figure(_map(found) if len(found) > _MOST_DRAWN else _courses(found), path, 130)


def _courses(found: Sequence[InjectorTrend]) -> Figure:
    columns = max(1, min(_SIDE_BY_SIDE, len(found)))
    rows = max(1, -(-len(found) // columns))
    figure = Figure(figsize=(5.0 * columns, 3.2 * rows), layout="constrained")
    places = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for number, place in enumerate(places.flat):
        if number < len(found):
            _draw(place, found[number])
            place.set_title(found[number].injector)
        else:
            place.axis("off")
    return figure


def _draw(axes: Axes, trend: InjectorTrend) -> None:
    times = date2num(trend.times)
    axes.xaxis_date()
    for name, course in trend.courses.items():
        if not course.level.size:
            continue
        low, high = course.band
        axes.fill_between(times, 100.0 * low, 100.0 * high, color=_COLOURS[name], alpha=0.2, lw=0)
        axes.plot(times, 100.0 * course.level, color=_COLOURS[name], lw=2, label=name)
        points: dict[str, Any] = {"fmt": "o", "ms": 3, "lw": 0.8, "color": _COLOURS[name], "alpha": 0.55}
        axes.errorbar(times, 100.0 * course.value, 100.0 * SURE * course.sigma, **points)
    axes.axhline(0.0, color="0.6", lw=0.8)
    axes.set_ylabel("change of flow, %")
    axes.tick_params(axis="x", labelrotation=20)
    if trend.times:
        axes.legend(loc="best", frameon=False)
    else:
        axes.text(0.5, 0.5, "no valid injection", transform=axes.transAxes, ha="center")


def _map(found: Sequence[InjectorTrend]) -> Figure:
    """Injectors downwards, the most worn first; time to the right; change of flow as colour."""
    figure, scale = (
        Figure(figsize=(12.0, min(16.0, 3.0 + 0.02 * len(found))), layout="constrained"),
        scale_of(found),
    )
    known = [date2num(trend.times) for trend in found if trend.times]
    begin, end = (min(each[0] for each in known), max(each[-1] for each in known)) if known else (0.0, 1.0)
    grid = np.linspace(begin, end, _COLUMNS)
    for axes, name in zip(figure.subplots(1, len(QUANTITIES), sharey=True), QUANTITIES, strict=True):
        image = axes.imshow(
            [_held(grid, trend, name) for trend in found],
            aspect="auto",
            interpolation="nearest",
            cmap="RdBu_r",
            vmin=-scale,
            vmax=scale,
            extent=(begin, end, len(found), 0),
        )
        axes.xaxis_date()
        axes.tick_params(axis="x", labelrotation=20)
        axes.set_title(f"{name} flow")
        axes.set_facecolor("0.85")
    axes.figure.colorbar(image, ax=figure.axes, label="change of flow, %")
    figure.axes[0].set_ylabel("injectors, the most worn first")
    return figure


def _held(grid: Signal, trend: InjectorTrend, name: str) -> Signal:
    """Level [%] on a grid of dates: of the recording before, NaN before the first."""
    place = np.searchsorted(date2num(trend.times), grid + 1e-9, side="right") - 1
    level = np.append(100.0 * trend.courses[name].level, np.nan)
    return np.asarray(level[place], float)
