"""`observer-rt fit`: healthy recordings in; the fitted injector file, and what it is worth, out."""

import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import load_injector
from observer_rt.config.injector_file import InjectorFile
from observer_rt.evidence.coverage import coverage
from observer_rt.evidence.excerpts import MOST_SAMPLES
from observer_rt.evidence.reading import hashes, read_measured, refuse_rates_missing
from observer_rt.fit.calibrate import calibrate
from observer_rt.fit.fitted_file import baseline_of, write_fitted
from observer_rt.fit.masses import read_masses
from observer_rt.fit.report import as_json, print_fit
from observer_rt.fit.suitability import refuse_clipped, warnings
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.foundation.file_errors import file_errors
from observer_rt.model.effect import SizedEffect
from observer_rt.recording.signals.stream import SignalStream
from observer_rt.terminal.compiling import show_compiling
from observer_rt.terminal.console import progress_bar, results, say
from observer_rt.terminal.destinations import FIGURE_SUFFIXES, check_destination, refuse_existing


@dataclass(frozen=True)
class FitOptions:
    """Options of the command. mass: CSV of measured masses; force: what stands there may be replaced."""

    model: Path
    output: Path
    mass: Path | None = None
    plot: Path | None = None
    json: bool = False
    force: bool = False


def fit_files(
    paths: Sequence[Path],
    options: FitOptions,
    console: Console,
    read: Callable[[Path], SignalStream],
    stated: tuple[SizedEffect, ...] = (),
) -> None:
    """Fit the model to recordings, write the fitted file, print what it is worth.

    read: looks through a file the user named, and refuses one that is none; stated: what the bench file says of the
    channels. Raises `UserError` for files that will not do, before the work begins; `RunError` when it fails or is
    interrupted.
    """
    file = load_injector(options.model)
    source = InjectorFile.read(options.model)
    _check_destinations(options)
    most = MOST_SAMPLES if options.mass is None else sys.maxsize  # whole: masses go by the injection's number
    found = read_measured(paths, read, console, most, stated)
    refuse_rates_missing([one.recording for one in found])
    refuse_clipped(found)
    weighed = {} if options.mass is None else read_masses(options.mass, found)
    warned = warnings(found)
    for line in (*map(coverage, found), *(f"warning: {one}" for one in warned)):
        say(console, line)
    show_compiling(console)
    with progress_bar(console, "fitting", 1.0) as progress:
        try:
            done = calibrate(file, found, weighed, progress)
        except KeyboardInterrupt:
            raise RunError("interrupted; nothing was written") from None
    baseline = baseline_of(done, hashes(paths))
    with file_errors(options.output):
        write_fitted(options.output, source, done, baseline)
    if options.plot is not None:
        from observer_rt.fit.figure import draw_fit

        draw_fit(options.plot, done)
    if options.json:
        print(json.dumps(as_json(done, baseline, warned), indent=2))
    else:
        print_fit(done, results())
    say(console, f"{options.output}: written" + ("" if options.plot is None else f"; {options.plot}: figure"))


def _check_destinations(options: FitOptions) -> None:
    if options.output.resolve() == options.model.resolve():
        raise UserError(
            f"--output {options.output}",
            "is the model that is fitted",
            "name another file, to compare the two",
        )
    check_destination("--output", options.output, (".toml",))
    refuse_existing("--output", [options.output], options.force)
    if options.plot is not None:
        check_destination("--plot", options.plot, FIGURE_SUFFIXES)
        refuse_existing("--plot", [options.plot], options.force)
