"""Recordings of the richer plant as files, for `fit` and for trying things out; the truth beside them."""

import subprocess
import sys
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.desk.simulation.simulate import SAC_PRESSURE, truth_path
from observer_rt.files.formats import write_recording
from observer_rt.files.signals.table_writers import (
    INJECTION_RATE,
    LINE_PRESSURE,
    NEEDLE_LIFT,
    TIME,
    write_columns,
)
from observer_rt.foundation.errors import RunError, UserError
from tests.observed_plants import recording_of
from tests.plants.healthy import healthy_benches, wave_bench
from tests.plants.laws import NO_LAWS, Laws
from tests.plants.parameters import Faults
from tests.plants.plant import SAMPLE_RATE, Bench, Outcome, record
from tests.plants.wave import Variant, new_part
from tools.benchmarks.campaign import Plan
from tools.benchmarks.cases import drawn_events
from tools.benchmarks.command_line import app, messages, tracked
from tools.benchmarks.lump_fit import RATE_NOISE

OUR_PROGRAM = (sys.executable, "-m", "observer_rt")
NEW_PART, FITTED, MADE_BY = "new_part.toml", "fitted.toml", "made_by.txt"
WRONG_LENGTH = 1.05  # of the line, as its maker says, where a measured rate can put it right


def faulty_bench(
    variant: Variant,
    seed: int,
    faults: Faults,
    laws: Laws = NO_LAWS,
    sample_rate: float = SAMPLE_RATE,
    averaged: bool = False,
) -> Bench:
    """Twenty events at changing operating points, faults and laws there from the start."""
    key = f"{faults}" if laws == NO_LAWS else f"{faults} {laws}"
    rng = np.random.default_rng([seed, zlib.crc32(key.encode())])
    events = tuple(replace(event, faults=faults) for event in drawn_events(rng, varying=True))
    bench = wave_bench(variant, seed, events, int(rng.integers(2**62)), sample_rate, averaged)
    return replace(bench, laws=laws)


def parsed_faults(texts: Sequence[str]) -> tuple[Faults, Laws]:
    """Faults, and laws beyond them, from texts NAME=VALUE. Raises `UserError` for another form."""
    known, values = (*Faults._fields, *Laws._fields), {}
    for text in texts:
        name, _, value = text.partition("=")
        if name not in known:
            raise UserError("--fault", f"unknown name '{name}'", f"known: {', '.join(known)}")
        try:
            values[name] = float(value)
        except ValueError:
            raise UserError("--fault", f"'{text}' has no number", f"give {name}=0.3, in SI units") from None
    faults = Faults(**{name: value for name, value in values.items() if name in Faults._fields})
    return faults, Laws(**{name: value for name, value in values.items() if name in Laws._fields})


def write_recordings(
    folder: Path, outcomes: Iterable[tuple[str, Outcome]], measured_rate: bool = False
) -> Iterator[Path]:
    """Write recordings by name, and truths, and the maker's injector file beside them; yields what is complete.

    measured_rate: the recordings have a measured rate, and the maker is wrong about the line's inertance.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / NEW_PART).write_text(maker_file(WRONG_LENGTH if measured_rate else 1.0))
    for name, outcome in outcomes:
        path, recording = folder / f"{name}.csv", recording_of(outcome)
        if measured_rate:
            # without a meter's error of gain, which no fit could tell from truth
            noise = np.random.default_rng(zlib.crc32(name.encode())).normal(
                0.0, RATE_NOISE, recording.samples
            )
            recording = replace(recording, injection_rate=outcome.truth.injection_rate + noise)
        write_recording(path, recording)
        columns = {
            TIME: outcome.measured.time,
            INJECTION_RATE: outcome.truth.injection_rate,
            NEEDLE_LIFT: outcome.truth.needle_lift,
            LINE_PRESSURE: outcome.truth.line_pressure,
            SAC_PRESSURE: outcome.truth.sac_pressure,
        }
        write_columns(truth_path(path), list(columns.items()))
        yield path


def maker_file(length: float = 1.0) -> str:
    """The injector file `fit` starts from: the nominal one with the sac of this part; `length` times its line's."""
    part = new_part()
    changes = {
        "sac_volume": f"sac_volume = {part.sac_volume:g}  # V_S, m3",
        "length": f"length = {length * part.line_length:g}  # L_L, m",
    }
    lines = NOMINAL_INJECTOR.read_text().splitlines()
    return "\n".join(changes.get(line.partition("=")[0].strip(), line) for line in lines) + "\n"


def fit_model(
    recordings: Sequence[Path],
    maker: Path,
    fitted: Path,
    program: Sequence[str] = OUR_PROGRAM,
    more: Sequence[str] = (),
) -> str:
    """Have `fit` make an injector file of recordings, from the maker's; what it says. Raises RunError.

    more: options of `fit`.
    """
    options = ["--model", str(maker), "--output", str(fitted), "--force", *more]
    command = [*program, "fit", *map(str, recordings), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RunError(f"observer-rt fit ended with {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def kept_fit(fitted: Path, state: str, fit: Callable[[], object]) -> Path:
    """An injector file that a fit has written; written anew where it is of another state of what it depends on."""
    made_by = fitted.with_name(MADE_BY)
    if not (fitted.exists() and made_by.exists() and made_by.read_text() == state):
        fit()
        made_by.write_text(state)
    return fitted


def fitted_model(
    plan: Plan, given: Path | None, variant: Variant = Variant.PLAIN, measured_rate: bool = False
) -> tuple[Path, dict[str, Outcome]]:
    """The injector file of a plan on tier B, fitted to healthy recordings unless it is given, and these recordings.

    Without peers and with a file given nothing is recorded. measured_rate: the fit has one, and a wrong inertance.
    """
    healthy, model = {}, given
    if plan.peers or given is None:
        benches = healthy_benches(variant, plan.master_seed)
        healthy = {name: record(benches[name]) for name in tracked(benches, "recording")}
    if model is None:
        model, folder = plan.out / FITTED, plan.out / "healthy"
        recordings = list(write_recordings(folder, healthy.items(), measured_rate))
        messages.print(fit_model(recordings, folder / NEW_PART, model), highlight=False, markup=False)
    load_injector(model)  # refused here, not in every process
    return model, healthy


@app.command(
    epilog="Example: tools/bench wave-recordings --out build/plain; observer-rt fit build/plain/*ms.csv ..."
)
def wave_recordings(
    out: Annotated[Path, typer.Option(help="Folder for the recordings and their truth.")],
    variant: Annotated[Variant, typer.Option(help="What the line is like.")] = Variant.PLAIN,
    fault: Annotated[
        list[str] | None,
        typer.Option(help="NAME=VALUE (SI; may be repeated): one recording of 20 events with it, instead."),
    ] = None,
    rate: Annotated[float, typer.Option(help="Sample rate [kHz], a divisor of 100.")] = 100.0,
    averaged: Annotated[
        bool, typer.Option("--averaged", help="Samples are means over the sample period that ends there.")
    ] = False,
    measured_rate: Annotated[
        bool,
        typer.Option(
            "--measured-rate", help="With a measured rate; the injector file's inertance is 5 % wrong."
        ),
    ] = False,
    seed: Annotated[int, typer.Option(help="Master seed.")] = 1,
) -> None:
    """Six healthy recordings of an injector on a line with travelling waves, as `fit` wants them."""
    if 100.0 % rate:
        raise UserError("--rate", f"{rate:g} kHz is no divisor of 100", "give 100, 50, 20 or 10")
    hz = 1e3 * rate
    if fault:
        benches = {"_".join(fault): faulty_bench(variant, seed, *parsed_faults(fault), hz, averaged)}
    else:
        benches = healthy_benches(variant, seed, hz, averaged)
    outcomes = ((name, record(benches[name])) for name in tracked(benches, "recording"))
    for path in write_recordings(out, outcomes, measured_rate):
        messages.print(f"{path}, truth beside it", highlight=False, soft_wrap=True)
