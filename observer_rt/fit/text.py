"""What a fit says on a terminal."""

import math
from collections.abc import Iterable, Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from observer_rt.estimation.phases import Phase
from observer_rt.evidence.pooled import Signal
from observer_rt.fit.calibrate import Calibrated
from observer_rt.fit.choice import judged_by
from observer_rt.fit.identifiability import interval
from observer_rt.fit.search import Failed, Fitted
from observer_rt.fit.words import kept_words, level_words, oddities, phase_name, verdict_words
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MM3_PER_MS
from observer_rt.terminal.console import say

_UNITS = {Signal.LINE_PRESSURE: (MEGAPASCAL, "MPa"), Signal.INJECTION_RATE: (MM3_PER_MS, "mm3/ms")}


def print_fit(done: Calibrated, console: Console) -> None:
    """Structures, parameters, residuals, level and verdict."""
    say(
        console,
        "structures, by chi2 on recordings left out (1: noise alone)",
    )
    console.print(_structures(done))
    for failed in (one for one in done.choice.tried if isinstance(one, Failed)):
        say(console, f"not fitted: {failed.structure.name}: it {failed.reason}")
    say(console, f"chosen: {done.choice.reason}\n")
    say(console, "parameters")
    console.print(_parameters(done))
    for line in (*kept_words(done), *_together(done), *oddities(done)):
        say(console, line)
    say(console, "\nresiduals, file -> fitted (rms one sample ahead; chi2 of means of 8 samples)")
    console.print(_residuals(done))
    before, after = (value / MEGAPASCAL for value in done.comparison.open_loop)
    say(
        console,
        f"line pressure with nothing corrected from the opening on: rms {_figure(before)} -> {_figure(after)} MPa",
    )
    for line in _masses(done):
        say(console, line)
    say(console, f"\nabsolute level: {level_words(done)}")
    say(console, f"verdict: {verdict_words(done)}")


def _structures(done: Calibrated) -> Table:
    table = _table(("structure", *map(phase_name, Phase), "free", ""), left=(0, 7), folded=0)
    for one in done.choice.tried:
        if isinstance(one, Fitted):
            table.add_row(*_structure(one, one is done.choice.best))
    return table


def _structure(one: Fitted, chosen: bool) -> Sequence[str]:
    chi2 = judged_by(one).chi2
    free = str(len(one.calibration.free))
    return (one.structure.name, *(_figure(chi2[phase]) for phase in Phase), free, "chosen" if chosen else "")


def _parameters(done: Calibrated) -> Table:
    table = _table(("parameter", "", "file", "fitted", "95 % interval", "unit"), left=(0, 1, 5))
    sigmas = done.fitted.certainty.sigmas
    for one, sigma in zip(done.fitted.calibration.free, sigmas, strict=True):
        before = one.stated(done.file)
        value = one.of(done.injector)
        low, high = (limit / one.si for limit in interval(value, float(sigma)))
        shown = "" if before is None else f"{before / one.si:.5g}"
        table.add_row(
            one.name, one.symbol, shown, f"{value / one.si:.5g}", f"{low:.5g} .. {high:.5g}", one.unit
        )
    return table


def _together(done: Calibrated) -> Iterable[str]:
    """The combination of parameters that is told worst."""
    if len(done.fitted.calibration.free) > 1:
        worst = done.fitted.certainty.directions[-1]
        yield f"told worst: {worst.words}, to {worst.sigma:.2%} (1 sigma)"


def _residuals(done: Calibrated) -> Table:
    table = _table(("signal", "phase", "rms", "", "", "unit", "chi2", "", ""), left=(0, 1, 5))
    for one in done.comparison.residuals:
        unit, name = _UNITS[one.signal]
        rms = [_figure(value / unit) for value in one.rms]
        chi2 = [_figure(value) for value in one.chi2]
        table.add_row(
            one.signal.value, phase_name(one.phase), rms[0], "->", rms[1], name, chi2[0], "->", chi2[1]
        )
    return table


def _masses(done: Calibrated) -> Iterable[str]:
    masses = done.comparison.masses
    after = np.array([one.after for one in masses])
    measured = np.array([one.measured for one in masses])
    if np.isfinite(measured).any():
        share = (after / measured - 1.0)[np.isfinite(measured)]
        worst = share[np.argmax(np.abs(share))]
        yield f"mass beside the measured: {np.mean(share):+.2%} in the mean, {worst:+.2%} at worst"
    before = np.array([one.before for one in masses])
    if np.isfinite(before).all():
        yield f"mass of an injection, mean: {np.mean(before) / MILLIGRAM:.2f} -> {np.mean(after) / MILLIGRAM:.2f} mg"
    because = "what a recording left out changes, structures that do as well, slow instants, a level measured"
    yield f"mass uncertain by the model: {done.mass_share:.2%} (1 sigma; {because})"


def _figure(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f"{value:.3g}" if value < 1000.0 else f"{value:.0f}"


def _table(names: Sequence[str], left: Sequence[int], folded: int | None = None) -> Table:
    """folded: the column that a narrow terminal breaks into lines; none else is."""
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
    for place, name in enumerate(names):
        table.add_column(name, justify="left" if place in left else "right", no_wrap=place != folded)
    return table
