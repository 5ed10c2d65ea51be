"""Figures of evaluated recordings: curves of some injections, masses and wear of all, as axes and as files."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from observer_rt.desk.evaluation.curves import MassRow, RateCurves, numbers_shown
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.engine.estimation.parameters import NOZZLE, SEAT
from observer_rt.engine.learning.kinds import BEFORE
from observer_rt.engine.reports.indicators import Estimate
from observer_rt.engine.reports.learned_laws import LearnedLaw
from observer_rt.files.learned_picture import FLOWS, draw_learned, height_of
from observer_rt.foundation.figures import NotebookFigure, save_figure
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLIGRAM, MILLISECOND, MM3_PER_MS, Z_95, Floats

ESTIMATED, NOMINAL, REFERENCE = "#d62728", "#1f77b4", "#222222"
RECORDINGS = ("#d62728", "#1f77b4", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2")
ANNOTATED = 24  # injections whose masses are bars with numbers; more are lines
WEAR = {NOZZLE: ("nozzle flow, v_H", FLOWS[NOZZLE][1], "-"), SEAT: ("seat flow, v_S", FLOWS[SEAT][1], ":")}
"""Learned quantities of an injector: name, colour and line where one recording is drawn."""
PERCENT = 100.0
DPI = 130
LEAST_SHOWN = 0.1  # % of a mass: what differs less is drawn as equal
CERTAIN = 0.95  # probability: where every event is so surely as before, no posterior is drawn
EXPECTED = "#d9d9d9"  # colour of events as before; other hypotheses have the colours of recordings
COLUMNS = 4  # of curves side by side
_LABELS = ("injection rate\n[mm³/ms]", "line pressure\n[MPa]", "needle lift\n[um]")
_LETTERS, _HANDLE = 12, 8  # that an inch of a legend holds; that a handle is wide


@dataclass(frozen=True)
class Picture:
    """Drawn data of one recording: curves of some injections by number, masses and wear of all, laws learned."""

    title: str
    curves: Mapping[int, RateCurves]
    masses: Sequence[MassRow]
    learned: Sequence[LearnedLaw] = ()


def draw_masses(axes: Axes, recordings: Sequence[Picture], reference: str) -> None:
    """Errors of the masses where all have a reference, else by how much they differ from the nominal model's."""
    rows = [row for recording in recordings for row in recording.masses]
    against = bool(rows) and all(row.reference for row in rows)
    label = f"mass error against {reference}\n[%]" if against else "mass against\nnominal model [%]"
    axes.axhline(0, color=REFERENCE if against else NOMINAL, lw=0.8)
    most = max((len(recording.masses) for recording in recordings), default=0)
    for i, recording in enumerate(recordings):
        table = _table(recording.masses, against)
        if len(recordings) == 1 and most <= ANNOTATED:
            _draw_bars(axes, table)
        else:
            colour = ESTIMATED if len(recordings) == 1 else RECORDINGS[i % len(RECORDINGS)]
            _draw_points(axes, table, colour, NOMINAL if len(recordings) == 1 else colour)
    axes.set(xlabel="injection", ylabel=label)
    axes.use_sticky_edges = False  # numbers of bars that hang down have room above them, too
    axes.margins(y=0.12)
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, -LEAST_SHOWN), max(high, LEAST_SHOWN))
    axes.xaxis.set_major_locator(MaxNLocator(ANNOTATED, integer=True, min_n_ticks=1))
    axes.grid(axis="y", alpha=0.3)
    if not rows:
        axes.text(0.5, 0.5, "no injection found", ha="center", transform=axes.transAxes)
        return
    is_bars = len(recordings) == 1 and most <= ANNOTATED
    notes = [] if against or not is_bars else ["numbers: mg"]
    if not all(row.valid for row in rows):
        notes.append(f"{'hatched' if is_bars else 'grey crosses'}: observer not valid")
    axes.set_title("; ".join(notes), loc="right", fontsize=9)


def _table(masses: Sequence[MassRow], against: bool) -> pd.DataFrame:
    """Masses and intervals by injection [%], against the reference, else the nominal model; said: at the bar."""
    unknown = np.nan, np.nan
    table = pd.DataFrame(
        [(row.number, row.valid, row.estimated, row.nominal, *(row.ci95 or unknown)) for row in masses],
        columns=["number", "valid", "estimated", "nominal", "low", "high"],
    )
    table = table.astype(float).astype({"valid": bool})
    table["said"] = table.estimated / MILLIGRAM
    base = [row.reference for row in masses] if against else table.nominal.where(table.nominal > 0.0)
    shown = ["estimated", "nominal", "low", "high"]
    table[shown] = PERCENT * (table[shown].div(np.array(base, float), axis=0) - 1.0)
    if against:
        table["said"] = table.estimated
    return table


def _draw_bars(axes: Axes, table: pd.DataFrame) -> None:
    axes.bar(table.number - 0.2, table.nominal, 0.38, color=NOMINAL)
    bars = axes.bar(table.number + 0.2, table.estimated, 0.38, color=ESTIMATED)
    axes.vlines(table.number + 0.2, table.low, table.high, color=REFERENCE, lw=1.2)
    for bar, row in zip(bars, table.itertuples(), strict=True):
        if not row.valid:
            bar.set(alpha=0.35, hatch="//")
        if np.isfinite(row.estimated):
            position = row.number + 0.2, max(np.fmax(row.high, row.estimated), 0.0)
            axes.annotate(f"{row.said:.2f}", position, (0, 2), textcoords="offset points", ha="center", fontsize=7)


def _draw_points(axes: Axes, table: pd.DataFrame, colour: str, nominal: str) -> None:
    """Points by themselves: from one injection to the next the operating point changes."""
    size = float(np.clip(400.0 / max(1, len(table)), 1.5, 5.0))
    axes.vlines(table.number, table.low, table.high, color=colour, alpha=0.35, lw=0.6 * size)
    axes.plot(table.number, table.nominal, "_", color=nominal, ms=2.0 * size)
    axes.plot(table.number, table.estimated, ".", color=colour, ms=2.0 * size)
    wrong = table[~table.valid]
    axes.plot(wrong.number, wrong.estimated, "x", color="#666666", ms=1.4 * size)


def draw_wear(axes: Axes, recordings: Sequence[Picture]) -> None:
    """Wear over injections with its 95 % interval, as far as it is known."""
    axes.axhline(0, color=REFERENCE, lw=0.8)
    shown: list[Floats] = []
    for i, recording in enumerate(recordings):
        numbers = np.array([row.number for row in recording.masses], float)
        for effect, (_, own, style) in WEAR.items():
            estimates = [row.wear.get(effect, Estimate(np.nan)) for row in recording.masses]
            value = PERCENT * np.array([estimate.value for estimate in estimates])
            half = PERCENT * Z_95 * np.array([estimate.sigma or np.nan for estimate in estimates])
            colour = own if len(recordings) == 1 else RECORDINGS[i % len(RECORDINGS)]
            axes.fill_between(numbers, value - half, value + half, color=colour, alpha=0.18, lw=0)
            axes.plot(numbers, value, style, color=colour, lw=1.4, marker="." if len(numbers) <= ANNOTATED else None)
            late = slice(half.size // 2, None)  # the first intervals are as wide as what is known beforehand
            shown += [value, (value - half)[late], (value + half)[late]]
    values = np.concatenate(shown) if shown else np.zeros(0)
    values = values[np.isfinite(values)]
    if values.size:
        low, high = min(values.min(), 0.0), max(values.max(), 0.0)
        margin = 0.1 * (high - low) or 1.0
        axes.set_ylim(low - margin, high + margin)
    handles = [
        Line2D([], [], color=own if len(recordings) == 1 else REFERENCE, ls=style, label=name)
        for name, own, style in WEAR.values()
    ]
    axes.legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False, ncols=2)
    axes.set(xlabel="injection", ylabel="learned change,\n95 % interval [%]")
    axes.grid(alpha=0.3)


def draw_posterior(axes: Axes, rows: Sequence[MassRow]) -> None:
    """Probability of every hypothesis of what an event was, stacked, an injection a bar."""
    table = pd.DataFrame([dict(row.posterior) for row in rows], index=[row.number for row in rows]).fillna(0.0)
    table = table[[BEFORE.name, *table.columns.drop(BEFORE.name, errors="ignore")]]
    height = np.zeros(len(table))
    for name, colour in zip(table, (EXPECTED, *RECORDINGS, *RECORDINGS), strict=False):
        axes.bar(table.index, table[name], 0.76, height, color=colour, label=name)
        height += table[name].to_numpy()
    axes.set(xlabel="injection", ylabel="probability of what\nthe event was", ylim=(0.0, 1.0))
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False, ncols=6)


def plot_injections(path: Path, recordings: Sequence[Picture], reference: str) -> None:
    """Write the figure of `injections_figure`, format by suffix."""
    save_figure(injections_figure(recordings, reference), path, DPI)


def injections_figure(recordings: Sequence[Picture], reference: str) -> Figure:
    """Draw curves of injections above, masses and wear below; several recordings have a colour each.

    One recording also shows uncertain events and learned laws. reference: "true", "measured".
    """
    numbers = sorted({number for picture in recordings for number in picture.curves})
    has_line = any(curve.line is not None for picture in recordings for curve in picture.curves.values())
    has_lift = has_line and any(curve.lift is not None for picture in recordings for curve in picture.curves.values())
    of_each = (3.4, *[2.2] * (has_line + has_lift))
    has_wear = any(row.wear for picture in recordings for row in picture.masses)
    panels: list[tuple[float, Callable[[Axes], None]]] = [
        (2.9, lambda axes: draw_masses(axes, recordings, reference))
    ]
    if has_wear:
        panels.append((2.6, lambda axes: draw_wear(axes, recordings)))
    beliefs = [dict(row.posterior) for row in recordings[0].masses if row.posterior]
    if len(recordings) == 1 and any(belief.get(BEFORE.name, 0.0) < CERTAIN for belief in beliefs):
        panels.append((1.6, lambda axes: draw_posterior(axes, recordings[0].masses)))
    heights = [height for height, _ in panels]
    rows, columns = -(-len(numbers) // COLUMNS), max(1, min(COLUMNS, len(numbers)))
    learned = recordings[0].learned if len(recordings) == 1 else ()
    sections = [sum(of_each)] * rows + [sum(heights)] + [height_of(learned)] * bool(learned)
    figure = NotebookFigure(figsize=(max(8.8, 4.1 * columns), sum(sections) + 0.8), layout="constrained")
    parts = figure.add_gridspec(len(sections), 1, height_ratios=sections)
    if learned:
        draw_learned(parts[-1], learned)
    for row in range(rows):
        grid = parts[row].subgridspec(len(of_each), columns, height_ratios=of_each)
        for column, number in enumerate(numbers[row * COLUMNS : (row + 1) * COLUMNS]):
            axes = [figure.add_subplot(grid[k, column]) for k in range(len(of_each))]
            _draw_injection(axes, recordings, number, reference, labelled=column == 0)
            if row == column == 0:
                _legend(figure, axes, recordings, reference)
    below = parts[rows].subgridspec(len(panels), 1, height_ratios=heights)
    of_all: list[Axes] = []
    for number, (_, draw) in enumerate(panels):
        of_all.append(figure.add_subplot(below[number], sharex=of_all[0] if of_all else None))
        draw(of_all[-1])
    for upper in of_all[:-1]:
        upper.set_xlabel("")
    if len(recordings) == 1:
        figure.suptitle(recordings[0].title, x=0.01, ha="left")
    return figure


def _legend(figure: Figure, axes: Sequence[Axes], recordings: Sequence[Picture], reference: str) -> None:
    handles: Sequence[Artist] = axes[0].get_legend_handles_labels()[0]
    if len(recordings) > 1:
        title = f"{len(recordings)} recordings; pale: {reference}, dashed: nominal model"
        titles = [picture.title for picture in recordings]
        handles = [Line2D([], [], color=RECORDINGS[i % len(RECORDINGS)], label=name) for i, name in enumerate(titles)]
        ncols = int(np.clip(_LETTERS * figure.get_figwidth() // (max(map(len, titles)) + _HANDLE), 1, COLUMNS))
        figure.legend(
            handles=handles, loc="outside upper left", ncols=ncols, title=title, alignment="left", frameon=False
        )
        return
    figure.legend(handles=handles, loc="outside upper right", ncols=4, frameon=False)
    for below in axes[1:]:
        below.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8, frameon=False, ncols=2, borderpad=0.0)


def _draw_injection(
    axes: Sequence[Axes], recordings: Sequence[Picture], number: int, reference: str, labelled: bool
) -> None:
    """One injection of every recording that has it: rates, line pressure and, where it was learned, lift below."""
    drawn = [(i, axis.curves[number]) for i, axis in enumerate(recordings) if number in axis.curves]
    is_alone = len(recordings) == 1
    for i, curve in drawn:
        time, colour = curve.time / MILLISECOND, RECORDINGS[i % len(RECORDINGS)]
        _draw_rates(axes[0], curve, reference, None if is_alone else colour)
        if len(axes) > 1 and curve.line is not None:
            measured, alpha = (REFERENCE, 0.55) if is_alone else (colour, 0.35)
            pressures = [values / MEGAPASCAL for values in curve.line]
            axes[1].plot(time, pressures[0], color=measured, lw=2.2, alpha=alpha, label="measured")
            axes[1].plot(time, pressures[1], color=colour, lw=1.1, label="observer, from the opening on")
        if curve.lift is not None:
            axes[-1].plot(time, curve.lift[0] / MICROMETRE, "--", color=colour, lw=1.4, label="lift, learned")
            if is_alone:
                said = axes[-1].text(0.5, 0.3, curve.lift[1], ha="center", fontsize=6.5, transform=axes[-1].transAxes)
                said.set_bbox({"facecolor": "white", "alpha": 0.8, "lw": 0.0})
    axes[0].set_title(drawn[0][1].title if is_alone else f"injection {number}")
    for axis in axes:
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("time [ms]")
    for upper in axes[:-1]:
        upper.sharex(axes[-1])
        upper.tick_params(labelbottom=False)
    for axis, label in zip(axes, _LABELS if labelled else (), strict=False):
        axis.set_ylabel(label)


def _draw_rates(axes: Axes, curve: RateCurves, reference: str, colour: str | None) -> None:
    """colour: of one recording among several; None: it is the only one, its curves differ by colour."""
    time = curve.time / MILLISECOND
    wide, alpha, thin = (2.4, 1.0, 0.9) if colour is None else (3.0, 0.3, 0.9)
    if curve.reference is not None:
        reference_rate = curve.reference / MM3_PER_MS
        axes.plot(time, reference_rate, color=colour or REFERENCE, lw=wide, alpha=alpha, label=reference)
    for rate, sigma, band, label in (
        (curve.estimated, curve.live_sigma, NOMINAL, "95 % of the live rate"),
        (curve.corrected, curve.sigma, ESTIMATED, "its 95 % interval"),
    ):
        if rate is not None and sigma is not None and colour is None:
            low, high = ((rate + side * Z_95 * sigma) / MM3_PER_MS for side in (-1, 1))
            axes.fill_between(time, low, high, color=band, alpha=0.2, lw=0, label=label)
    estimates = [(curve.estimated, 1.4, "observer")]
    if curve.corrected is not None and np.isfinite(curve.corrected).any():
        estimates = [(curve.estimated, thin, "observer, live"), (curve.corrected, 2.0, "by its own pressures")]
    for rate, width, label in estimates:
        axes.plot(time, rate / MM3_PER_MS, color=colour or ESTIMATED, lw=width, label=label)
    axes.plot(time, curve.nominal / MM3_PER_MS, color=colour or NOMINAL, ls="--", lw=thin, label="nominal model")
    if curve.sigma is not None and colour is None:  # An interval that tells nothing is not to flatten the curves.
        drawn = np.concatenate([line.get_ydata() for line in axes.lines])
        drawn = drawn[np.isfinite(drawn)]
        if drawn.size:
            margin = 0.1 * float(np.ptp(drawn)) or 1.0
            axes.set_ylim(drawn.min() - margin, drawn.max() + margin)


def pictures_of(evaluations: Sequence[Evaluation], chosen: Sequence[int] = ()) -> list[Picture]:
    """Masses and wear of all injections, curves of those chosen, else three. Raises `UserError` for unknown ones."""
    numbers = {injection.number for evaluation in evaluations for injection in evaluation.injections}
    shown = numbers_shown(chosen, numbers)
    return [_picture_of(evaluation, shown) for evaluation in evaluations]


def _picture_of(evaluation: Evaluation, numbers: Collection[int]) -> Picture:
    curves = {number: evaluation.curves[number] for number in numbers if number in evaluation.curves}
    masses = [
        MassRow(
            result.number,
            result.mass,
            result.nominal_mass,
            None if np.isnan(result.measured_mass) else result.measured_mass,
            result.valid,
            result.mass_ci95,
            {effect: result.indicators[effect] for effect in (NOZZLE, SEAT)},
            result.posterior,
        )
        for result in evaluation.injections
    ]
    return Picture(str(evaluation.path), curves, masses, evaluation.learned)
