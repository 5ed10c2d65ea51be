"""Reports a fit: sentences, tables in printed units, and a figure."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter
from rich.console import Console

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.console import plain_table, say
from observer_rt.foundation.figures import FOUND, GIVEN, LOOK, MEASURED, NotebookFigure, save_figure
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND
from observer_rt.identification.fit.calibrate import GATE, TOLERATED, CalibrationResult, FlowLevel, judged_by
from observer_rt.identification.fit.cross_validation import WORTH_A_WORD, share_between_samples, spread
from observer_rt.identification.fit.residuals import FoldOverlay
from observer_rt.identification.fit.search import FailedStructure, FittedStructure
from observer_rt.identification.likelihood.measurement import open_time, rail_pressure_before
from observer_rt.identification.likelihood.operating_points import point_name
from observer_rt.model.plausibility import ImplausibleNumber, implausible, wrong_entry

_SEAT = "check the lift's calibration and the seat's geometry, and run `discover` on these recordings"
_TRY = {
    Phase.STANDSTILL: "with the needle shut there is more than white noise: give the line pressure as "
    "it was sampled, not smoothed, interpolated or resampled; else look for an offset that drifts",
    Phase.OPENING: _SEAT,
    Phase.OPEN: "check the chamber pressure, and run `discover` on these recordings: cavitation, or a coefficient "
    "of the seat that depends on the lift, shows here",
    Phase.CLOSING: _SEAT,
    Phase.AFTER: "the line rings otherwise than any structure tried (friction that depends on frequency is in none): "
    "check line.length, and where along the line the pressure is measured",
}
_FOREIGN = 500.0  # chi2 that no wrong number of the file leaves
_OF_FOREIGN = (
    "most probably the signals do not belong together: a lift that is later or earlier than the pressures (another "
    "clock, a delay of its channel; 0.1 ms does this), or a line pressure of another place, or of the wrong sign; "
    "compare them in --plot. Lengths and diameters wrong by less than a factor of two are not the cause: the fit "
    "makes up for them. Or the injector of these recordings has changed, its nozzle or seat: fit to those of when it "
    "was healthy, then `observer-rt discover` names what changed"
)
_OF_INSTANTS = "; if samples are means over the sample period, state it (warning above)"
_FITTED = "; line.diameter stands for A_L/(rho_L L_L) and was fitted with it"
_MOST = 6  # overlays
_COLUMNS = 3
_SHOWN = 4e-3  # s after the opening
_LEAST = 0.1  # of a chi2 on the axis


def phase_name(phase: Phase) -> str:
    """In lower case."""
    return phase.name.lower()


def level_words(done: CalibrationResult) -> str:
    """Describes what fixes the absolute level of flow."""
    if done.level is FlowLevel.RATE:
        return f"fixed by the measured injection rate{_FITTED}"
    if done.level is FlowLevel.MASS:
        return f"fixed by the measured masses{_FITTED}"
    return (
        "rests one to one on A_L/(rho_L L_L) of the file (line.diameter, line.length, fluid.density_line): pressures "
        "alone do not determine it. If that is 5 % too large, so are all masses and the fitted alpha_H, alpha_S, V_S "
        "and V_L/K_L. A measured rate (column injection_rate) or one measured mass (--mass) fixes it"
    )


def verdict_words(done: CalibrationResult) -> str:
    """Adequate or not, where, and what to try; with which numbers no injector has."""
    odd = ", ".join(one.name for one in _beyond_physics(done))
    return _fit_words(done) + (f". IMPLAUSIBLE: {odd}; correct the file and fit again" if odd else "")


def _fit_words(done: CalibrationResult) -> str:
    left = done.left
    if not done.inadequate:
        words = (
            f"adequate: chi2 at most {left.chi2[left.worst]:.2f} ({phase_name(left.worst)}; limit {GATE:g})"
        )
        if done.above_gate:
            most = max(map(done.comparison.share, done.above_gate))
            words += (
                f", which these sensors show: it is {most:.2%} of the swing of the line pressure, and up to "
                f"{TOLERATED:.1%} moves no mass that matters"
            )
        return words
    where = ", ".join(f"{phase_name(phase)} {left.chi2[phase]:.3g}" for phase in done.inadequate)
    return f"INADEQUATE: chi2 above {GATE:g} in {where}. To try: {_to_try(done)}"


def _to_try(done: CalibrationResult) -> str:
    """By the most probable cause."""
    worst = done.inadequate[0]
    if done.left.chi2[worst] > _FOREIGN:
        return _OF_FOREIGN
    if Phase.STANDSTILL in done.inadequate:
        return _TRY[Phase.STANDSTILL]
    slow = max(map(share_between_samples, done.measurements)) > WORTH_A_WORD
    return _TRY[worst] + (_OF_INSTANTS if slow else "")


def recording_name(done: CalibrationResult, recording: int) -> str:
    """The file of a recording, or its number."""
    return str(done.measurements[recording].recording.path or recording)


def oddities(done: CalibrationResult) -> list[str]:
    """Fitted numbers that physics does not allow, with the entry of the file that is probably wrong; those at an end
    of the range tried."""
    free = done.fitted.calibration.free
    odd = _beyond_physics(done)
    result = [f"implausible: {parameter.words}" for parameter in odd]
    if cause := wrong_entry(done.injector, odd):
        result.append(f"most probably, {cause}")
    for parameter in free:
        value = parameter.of(done.injector)
        if value < 1.01 * parameter.lowest or value > 0.99 * parameter.highest:
            result.append(
                f"{parameter.name} = {value / parameter.si:.4g} {parameter.unit} is at the end of the range tried"
            )
    return result


def _beyond_physics(done: CalibrationResult) -> list[ImplausibleNumber]:
    """Implausible numbers among the parameters fitted."""
    names = {one.name for one in done.fitted.calibration.free}
    return [one for one in implausible(done.injector) if one.name in names]


def print_fit(done: CalibrationResult, console: Console) -> None:
    """Structures, parameters, residuals, level and verdict."""
    say(console, "structures, by chi2 on recordings left out (1: noise alone)")
    structures = [
        (
            one.structure.name,
            *(_figure(judged_by(one).chi2[phase]) for phase in Phase),
            str(len(one.calibration.free)),
            "chosen" if one is done.choice.best else "",
        )
        for one in done.choice.tried
        if isinstance(one, FittedStructure)
    ]
    names = ("structure", *map(phase_name, Phase), "free", "")
    console.print(plain_table(names, structures, right=range(1, 7), folds=(0,)))
    for failed in (one for one in done.choice.tried if isinstance(one, FailedStructure)):
        say(console, f"not fitted: {failed.structure.name}: it {failed.reason}")
    say(console, f"chosen: {done.choice.reason}\n")
    say(console, "parameters")
    parameters = [
        (
            name,
            size.symbol,
            "" if size.file is None else f"{size.file:.5g}",
            f"{size.value:.5g}",
            *("{:.5g} .. {:.5g}".format(*size.ci95), size.unit),
        )
        for name, size in done.sizes.items()
    ]
    names = ("parameter", "", "file", "fitted", "95 % interval", "unit")
    console.print(plain_table(names, parameters, right=(2, 3, 4), folds=()))
    for kept in done.kept:
        value = f"{kept.of(done.injector) / kept.si:.4g} {kept.unit}"
        say(console, f"{kept.name} ({kept.symbol}) stays {value}: these recordings do not determine it")
    if len(done.fitted.calibration.free) > 1:
        worst = done.fitted.certainty.directions[-1]
        say(console, f"least certain: {worst.words}, to {worst.sigma:.2%} (1 sigma)")
    for line in oddities(done):
        say(console, line)
    say(console, "\nresiduals, file -> fitted (rms one sample ahead; chi2 of means of 8 samples)")
    residuals = [
        (*(left.signal.value, left.phase, *_arrow(left.rms)), *(left.unit, *_arrow(left.chi2)))
        for left in done.comparison.residuals
    ]
    names = ("signal", "phase", "rms", "", "", "unit", "chi2", "", "")
    console.print(plain_table(names, residuals, right=(2, 3, 4, 6, 7, 8), folds=()))
    open_loop = " ".join(_arrow(done.comparison.open_loop))
    say(console, f"line pressure with nothing corrected from the opening on: rms {open_loop} MPa")
    for line in _masses(done):
        say(console, line)
    say(console, f"\nabsolute level: {level_words(done)}")
    say(console, f"verdict: {verdict_words(done)}")


def _masses(done: CalibrationResult) -> Iterable[str]:
    masses = done.comparison.masses
    after = np.array([one.mass_mg for one in masses], float)
    measured = np.array([one.measured_mass_mg for one in masses], float)
    if np.isfinite(measured).any():
        share = (after / measured - 1.0)[np.isfinite(measured)]
        worst = share[np.argmax(np.abs(share))]
        yield f"mass beside the measured: {np.mean(share):+.2%} in the mean, {worst:+.2%} at worst"
    before = np.array([one.file_mass_mg for one in masses], float)
    if np.isfinite(before).all():
        yield f"mass of an injection, mean: {np.mean(before):.2f} -> {np.mean(after):.2f} mg"
    because = "what a recording left out changes, structures that do as well, slow instants"
    yield f"mass uncertain by the model: {done.mass_share:.2%} (1 sigma; {because})"


def _arrow(values: Mapping[str, float | None]) -> tuple[str, str, str]:
    return _figure(values["file"]), "->", _figure(values["fitted"])


def _figure(value: float | None) -> str:
    if value is None or math.isnan(value):
        return "-"
    return f"{value:.3g}" if value < 1000.0 else f"{value:.0f}"


def draw_fit(path: Path, done: CalibrationResult) -> None:
    """Write the figure of `fit_figure`; its kind is that of the suffix."""
    with mpl.rc_context(LOOK):
        save_figure(fit_figure(done), path, 110)


def fit_figure(done: CalibrationResult) -> Figure:
    """Draw line pressures before and after, and residuals by phase."""
    overlays = spread(done.comparison.overlays, _MOST)
    rows = -(-len(overlays) // _COLUMNS)
    with mpl.rc_context(LOOK):
        figure = NotebookFigure(figsize=(12.0, 2.9 * rows + 3.6), layout="constrained")
        grid = figure.add_gridspec(rows + 1, _COLUMNS, height_ratios=[1.0] * rows + [1.15])
        for number, overlay in enumerate(overlays):
            axes = figure.add_subplot(grid[number // _COLUMNS, number % _COLUMNS])
            _overlay(axes, overlay, legend=number == 0)
        _phases(figure.add_subplot(grid[rows, :]), done)
        figure.suptitle(f"{done.fitted.structure.name}: {verdict_words(done).split('. ')[0]}", fontsize=11)
    return figure


def _overlay(axes: Axes, overlay: FoldOverlay, legend: bool) -> None:
    """The first injection of a fold."""
    measurement, after = overlay.fold.measurement, overlay.after[0]
    recording, interval = measurement.recording, measurement.interval
    shown = after.samples[: round(_SHOWN / interval)]
    since = (shown - shown[0]) * interval / MILLISECOND
    axes.plot(since, recording.line_pressure[shown] / MEGAPASCAL, color=MEASURED, lw=0.8, label="measured")
    if overlay.before:
        before = overlay.before[0].line_pressure[: shown.size]
        axes.plot(since, before / MEGAPASCAL, color=GIVEN, lw=1.0, ls="--", label="file")
    axes.plot(since, after.line_pressure[: shown.size] / MEGAPASCAL, color=FOUND, lw=1.0, label="fitted")
    point = point_name(rail_pressure_before(after.event, recording), open_time(after.event, recording))
    axes.set_title(point, fontsize=9)
    axes.set_xlabel("time since opening [ms]")
    axes.set_ylabel("line pressure [MPa]")
    if legend:
        axes.legend(frameon=False, fontsize=8)


def _phases(axes: Axes, done: CalibrationResult) -> None:
    """chi2 of every signal and phase, before and after."""
    residuals = done.comparison.residuals
    places = np.arange(len(residuals))
    before, after = (np.array([one.chi2[by] for one in residuals], float) for by in ("file", "fitted"))
    both = bool(np.isfinite(before).any())
    if both:
        axes.bar(places - 0.2, before, 0.38, color=GIVEN, label="file")
    axes.bar(places + 0.2 * both, after, 0.38, color=FOUND, label="fitted")
    axes.axhline(GATE, color="#59636e", lw=1.0, ls=":")
    axes.text(len(residuals) - 0.55, GATE, "limit", va="bottom", ha="right", fontsize=8, color="#59636e")
    axes.axhline(1.0, color="#59636e", lw=0.6)
    axes.grid(visible=False, axis="x")
    axes.set_yscale("log")
    axes.set_ylim(_LEAST, 1.5 * float(np.nanmax([*before, *after, GATE])))
    axes.yaxis.set_major_formatter(ScalarFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xticks(places, [f"{one.phase}\n{one.signal.words}" for one in residuals])
    axes.set_ylabel("chi2 (1: noise alone)")
    axes.legend(frameon=False, fontsize=8, loc="upper right")
