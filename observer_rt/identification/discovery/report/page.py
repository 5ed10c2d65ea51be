"""Builds report.html: the answer in the words of the terminal, then what it rests on, in figures and tables."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import attrgetter

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from observer_rt.engine.estimation.phases import Phase
from observer_rt.files.learned_picture import learned_figure
from observer_rt.foundation import units
from observer_rt.foundation.figures import FOUND, GIVEN, MEASURED, svg_figure
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLISECOND, MM3_PER_MS, shown, sign, significant
from observer_rt.foundation.version import __version__
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.injections import LINE_PRESSURE, Gap, MassChange, Overlay
from observer_rt.identification.discovery.report import text
from observer_rt.identification.discovery.search import proposal
from observer_rt.identification.discovery.search.adequacy import SIGNIFICANT_EXCESS, Disagreement
from observer_rt.identification.discovery.search.candidates import Candidate
from observer_rt.identification.discovery.search.laws import guess_words
from observer_rt.identification.discovery.search.results import Cell, Discovery, SmallestVisible, Verdict
from observer_rt.identification.discovery.standstill import StandstillFigure
from observer_rt.identification.likelihood.signals import Signal
from observer_rt.model.effect import Equation
from observer_rt.model.effects import VOCABULARY

_FEWEST_PLACES = 3  # bars for which a figure always has room
_CROWDED = 9  # operating points: from so many on, labels are small
REDDEST_RATIO = 10.0  # times the noise, from which on a cell is as red as it gets
_WHITE, _RED = (255, 246, 240), (176, 38, 28)
_CALM = "#eef4f0"


def overlay_figure(findings: Findings) -> str:
    """Lift, line pressure, its residuals under the models, and injection rate; a column for each injection."""
    labels = ("needle lift\n[µm]", "line pressure\n[MPa]", "model − measured\n[MPa]", "injection rate\n[mm³/ms]")
    with svg_figure(10.4, 7.4) as (figure, svg):
        grid = figure.add_gridspec(4, len(findings.overlays), height_ratios=(0.55, 1.5, 1.0, 1.3))
        for column, overlay in enumerate(findings.overlays):
            axes = [figure.add_subplot(grid[row, column]) for row in range(4)]
            _draw_overlay(axes, overlay, with_words(findings))
            for row, label in enumerate(labels):
                axes[row].sharex(axes[0])
                axes[row].tick_params(labelbottom=row == 3)
                if column == 0:
                    axes[row].set_ylabel(label)
            axes[0].set_title(overlay.title, loc="left", fontsize=10.5, fontweight="bold")
            axes[3].set_xlabel("time since the opening [ms]")
            if column == 0:
                _legend(figure, axes[1])
        figure.align_ylabels()
    return svg()


def _legend(figure: Figure, axes: Axes) -> None:
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper right", ncols=3, frameon=False)


def _draw_overlay(axes: Sequence[Axes], overlay: Overlay, amended: str) -> None:
    measurement, before, shown = overlay.measurement, overlay.before, slice(0, overlay.samples)
    recording, samples = measurement.recording, before.samples[shown]
    time = (samples - samples[0]) * measurement.interval / MILLISECOND
    lift, measured = (recording.needle_lift[samples] / MICROMETRE, recording.line_pressure[samples] / MEGAPASCAL)
    axes[0].fill_between(time, lift, color="#dfe5ea", lw=0)
    axes[0].plot(time, lift, color="#59636e", lw=0.9)
    axes[1].plot(time, measured, color=MEASURED, lw=1.5, alpha=0.75, label="measured")
    floor = 2.0 * overlay.noise_floor / MEGAPASCAL
    axes[2].axhspan(-floor, floor, color="#e8ecef", lw=0)
    if recording.injection_rate is not None:
        rate = recording.injection_rate[before.rate_samples[shown]] / MM3_PER_MS
        axes[3].plot(time, rate, color=MEASURED, lw=1.5, alpha=0.75)
    models = ("model as given", before, GIVEN, "-"), (amended, overlay.after, FOUND, (0, (5, 1.5)))
    for label, run, colour, style in models:
        if run is not None:
            pressure = run.line_pressure[shown] / MEGAPASCAL
            axes[1].plot(time, pressure, color=colour, lw=1.1, ls=style, label=label)
            axes[2].plot(time, pressure - measured, color=colour, lw=0.8)
            axes[3].plot(time, run.shown_rate[shown] / MM3_PER_MS, color=colour, lw=1.1, ls=style)


def gap_figure(findings: Findings) -> str:
    """Gaps before and after at every operating point held out, side by side; the noise is a line."""
    points, amended = findings.gaps.points, bool(findings.shown.ids)
    labels = [findings.cell_of_point[point.recording].point.replace(", ", "\n") for point in points]
    groups = [gap for gap in findings.gaps.by_name.values() if gap.measured or amended]
    with svg_figure(10.4, 3.1) as (figure, svg):
        for column, gap in enumerate(groups):
            axes = figure.add_subplot(1, len(groups), column + 1)
            every = [point.by_name[gap.name] for point in points if gap.name in point.by_name]
            _draw_bars(axes, labels, every, with_words(findings) if amended and gap.measured else None)
            unit, doubt = (sign(gap.unit), "") if gap.measured else (gap.unit, ", if this is right")
            axes.set_ylabel(f"rms [{unit}]")
            axes.set_title(f"{gap.words}{doubt}", loc="left", fontsize=10.5, fontweight="bold")
            if column == 0:
                _legend(figure, axes)
    return svg()


def _draw_bars(axes: Axes, labels: Sequence[str], gaps: Sequence[Gap], amended: str | None) -> None:
    """amended: name of the amended model in the legend; None: there is no amended model."""
    places = np.arange(len(labels))
    width = 0.5 if amended is None else 0.36
    series = [("model as given", [gap.before for gap in gaps], GIVEN, 0.0 if amended is None else -0.2)]
    if amended is not None:
        series.append((amended, [gap.after for gap in gaps], FOUND, 0.2))
    floors = np.array([gap.noise_floor for gap in gaps])
    for label, values, colour, shift in series:
        heights = np.array(values)
        axes.bar(places + shift, heights, width, color=colour, label=label)
        tops = np.maximum(heights, floors)  # numbers stand above the line of the noise, too
        for position, top, height in zip(places + shift, tops, heights, strict=True):
            text = f"{height:.0f}" if height >= 10.0 else f"{height:#.2g}"
            axes.annotate(text, (position, top), (0, 2), textcoords="offset points", ha="center", fontsize=8)
    axes.hlines(floors, places - 0.45, places + 0.45, color=MEASURED, lw=1.4, label="noise alone")
    axes.margins(y=0.15)
    axes.set_ylim(bottom=0.0)
    axes.grid(axis="x", visible=False)
    axes.set_xticks(places, labels)
    spare = 0.6 + max(0.0, (_FEWEST_PLACES - places.size) / 2.0)  # So that a single bar does not fill the figure.
    axes.set_xlim(-spare, places.size - 1.0 + spare)


def residual_figure(findings: Findings) -> str:
    """Residuals of the models for every injection, recording by recording; those held out have a grey ground."""
    label = with_words(findings) if findings.shown.ids else None
    held_out = findings.gaps.held_out if findings.held_apart else ()
    middles: dict[float, str] = {}
    start = 0.0
    with svg_figure(10.4, 2.9) as (figure, svg):
        axes = figure.add_subplot()
        for number, injections in groupby(findings.injections, attrgetter("recording")):
            every = tuple(injections)
            x, model_label = start + np.arange(len(every)), None if middles else "model as given"
            axes.plot(x, [one.before / MEGAPASCAL for one in every], "o", ms=4, color=GIVEN, label=model_label)
            if label is not None:
                after = [one.after / MEGAPASCAL for one in every]
                axes.plot(x, after, "o", ms=4, color=FOUND, label=None if middles else label)
            if number in held_out:
                axes.axvspan(x[0] - 0.7, x[-1] + 0.7, color="#eef1f4", lw=0, zorder=0)
            middles[(x[0] + x[-1]) / 2.0] = findings.cell_of_point[number].point.replace(", ", "\n")
            start = x[-1] + 2.4
        axes.axhline(findings.gaps.by_name[LINE_PRESSURE].noise_floor, color=MEASURED, lw=1.2, label="noise alone")
        axes.set_xticks(list(middles), list(middles.values()))
        axes.tick_params(axis="x", length=0, labelsize=8 if len(middles) > _CROWDED else None)
        axes.grid(axis="x", visible=False)
        axes.set_ylim(bottom=0.0)
        axes.margins(x=0.02)
        axes.set_ylabel("line pressure,\nrms [MPa]")
        _legend(figure, axes)
    return svg()


def with_words(findings: Findings) -> str:
    """Name of the amended model for a legend."""
    if findings.effects or findings.proposal is None:
        return f"with {' and '.join(findings.named.ids)}"
    return f"with proposal {findings.proposals.index(findings.proposal) + 1}"


def standing(candidate: Candidate, discovery: Discovery) -> str:
    """Rates a candidate of the ranking, in words."""
    doubt = "too small, or at a bound" if candidate.ids and not candidate.plausible else ""
    if candidate.ids in discovery.rivals:
        return "tied"
    if discovery.verdict is Verdict.UNKNOWN and candidate.ids == discovery.best.ids:
        return ", ".join(one for one in ("nearest, not enough", doubt) if one)
    return doubt


def mass_share(change: MassChange) -> str:
    """The change of a mass as a share, with its interval."""
    half = 100.0 * change.half / change.nominal
    step = 10.0 * significant(max(half, 1e-3))
    return f"{'' if change.change_pct < 0.0 else '+'}{shown(change.change_pct, step)} ± {shown(half, step)} %"


def with_sigma(figure: StandstillFigure) -> str:
    """A figure of the standstill with its standard deviation."""
    if math.isnan(figure.sigma):
        return f"{figure.value:#.3g}"
    step = significant(figure.sigma)
    return f"{shown(figure.value, step)} ± {shown(figure.sigma, step)}"


def healthy_words(smallest: SmallestVisible, findings: Findings) -> str:
    """Says how large an effect appears to be on the healthy injector."""
    appears = {} if findings.baseline is None else findings.baseline.appears
    if (apparent := appears.get(smallest.id)) is None:
        return "–"
    step = significant(max(apparent.uncertainty, apparent.scatter))
    scatter = f" ± {shown(apparent.scatter, step)}" if apparent.scatter > 0.0 else ""
    return f"{smallest.parameter} = {shown(apparent.mean, step)}{scatter} {sign(apparent.unit)}".rstrip()


@dataclass(frozen=True)
class ShownCell:
    """A cell: its number, colours of ground and text, and its tool tip."""

    text: str
    colour: str
    ink: str
    tip: str


def map_columns(where: Sequence[Disagreement]) -> dict[Signal, list[Phase]]:
    """Phases of every signal in the map."""
    present = {(item.before.signal, item.before.phase) for item in where}
    columns = {signal: [phase for phase in Phase if (signal, phase) in present] for signal in Signal}
    return {signal: phases for signal, phases in columns.items() if phases}


def shown_cells(where: Sequence[Disagreement], side: str) -> dict[tuple[int, Signal, Phase], ShownCell]:
    """Cells of the map. side: `before` or `after`."""
    cells = ((getattr(item, side), item.equation) for item in where)
    return {(cell.recording, cell.signal, cell.phase): _shown(cell, equation) for cell, equation in cells}


def _shown(cell: Cell, equation: Equation | None) -> ShownCell:
    ratio, signal = math.sqrt(cell.variance), cell.signal
    rms = f"{cell.rms / signal.si:.3g} {sign(signal.unit)} rms"
    tip = f"{rms}, {cell.excess:.1f} standard deviations beyond noise"
    if equation is not None:
        tip += f"; equation: {equation.value.replace('_', ' ')}"
    stands_out = cell.excess > SIGNIFICANT_EXCESS
    ratio = max(ratio, math.sqrt(cell.colour)) if stands_out else ratio
    digits = 2 if ratio < 2.0 else 1 if ratio < 100.0 else 0
    ink = "#fff" if stands_out and ratio > 0.5 * REDDEST_RATIO else "inherit"
    share = min(1.0, max(0.0, math.log(max(ratio, 1.0)) / math.log(REDDEST_RATIO)))
    red = "rgb({}, {}, {})".format(*(round(w + share * (r - w)) for w, r in zip(_WHITE, _RED, strict=True)))
    return ShownCell(f"{ratio:.{digits}f}", red if stands_out else _CALM, ink, tip)


# a name that a template is not given is an error
_PAGES = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined)
_PAGES.loader = PackageLoader(__package__)
for _names in (*map(vars, (units, proposal, text)), globals()):
    _PAGES.globals |= _names
_PAGES.globals |= {"version": __version__, "VOCABULARY": VOCABULARY, "isfinite": math.isfinite}
_PAGES.globals |= {"learned_figure": learned_figure, "guess_words": guess_words}
_PAGES.filters["with_code"] = lambda text: Markup(re.sub("`(.+?)`", r"<code>\1</code>", str(escape(text))))
_PAGES.filters["sentence"] = lambda text: text[:1].upper() + text[1:]


def report(findings: Findings) -> str:
    return _PAGES.get_template("report.html.j2").render(findings=findings)
