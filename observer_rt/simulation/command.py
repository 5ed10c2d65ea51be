"""`observer-rt simulate`: options to files."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import load_injector
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MILLISECOND
from observer_rt.model.fuel import at_temperature, temperature_of
from observer_rt.recording.formats import signal_formats, suffixes_of, write_recording, written
from observer_rt.simulation.effects import parse_effects, sizes_of
from observer_rt.simulation.measurement import NoiseLevels
from observer_rt.simulation.schedule import (
    make_schedule,
    parse_energizing_times,
    parse_rail_pressures,
    parse_shots,
)
from observer_rt.simulation.simulate import simulate, truth_path, write_truth
from observer_rt.terminal.compiling import show_compiling
from observer_rt.terminal.console import progress_bar, say
from observer_rt.terminal.destinations import check_destination, refuse_existing

MAX_SAMPLES = 20_000_000  # that a machine of 4 GiB can hold with their truth


@dataclass(frozen=True)
class SimulateOptions:
    """Options of the command, as texts where they are lists; units are those of their names, else SI."""

    model: Path
    rail_pressure: str
    """MPa, comma separated."""
    energizing_time: str
    """ms, comma separated."""
    injections: int
    period_ms: float
    sample_rate: float
    shots: str | None
    effects: Sequence[str]
    noise: str
    measured_rate: bool
    seed: int
    fuel_temperature: float | None
    """degC; None: as in the injector file."""
    force: bool = False
    """Replace files that are there."""


def simulate_to_file(output: Path, options: SimulateOptions, console: Console) -> None:
    """Write a recording and, beside it, its truth. Raises `UserError` for options that make no sense."""
    if options.noise not in ("on", "off"):
        raise UserError("--noise", f"is {options.noise!r}", "give on or off")
    check_destination("--output", output, suffixes_of(written(signal_formats())))
    refuse_existing("--output", [output, truth_path(output)], options.force)
    period, sample_rate = options.period_ms * MILLISECOND, options.sample_rate
    samples = options.injections * period * sample_rate
    if samples > MAX_SAMPLES:
        raise UserError(
            "--injections",
            f"{options.injections} events every {options.period_ms:g} ms at {sample_rate:g} Hz are {samples:.3g} "
            f"samples (at most {MAX_SAMPLES:.3g})",
            "write several recordings; `evaluate --chain` takes them as one history",
        )
    schedule = make_schedule(
        parse_rail_pressures(options.rail_pressure),
        options.injections,
        period,
        parse_energizing_times(options.energizing_time),
        parse_shots(options.shots) if options.shots else (),
    )
    injector = load_injector(options.model)
    if options.fuel_temperature is not None:
        injector = at_temperature(injector, temperature_of("--fuel-temperature", options.fuel_temperature))
    effects = parse_effects(options.effects)
    show_compiling(console)
    with progress_bar(console, "simulating", 1.0) as progress:
        simulation = simulate(
            injector,
            schedule,
            sample_rate,
            effects,
            NoiseLevels() if options.noise == "on" else None,
            options.measured_rate,
            options.seed,
            progress,
        )
    write_recording(output, simulation.recording)
    write_truth(truth_path(output), simulation.truth)
    say(
        console,
        f"{output}: {simulation.recording.samples} samples at {sample_rate:g} Hz, {options.injections} events, "
        f"{'; '.join(map(sizes_of, effects)) or 'no effect'}; "
        f"truth in {truth_path(output).name}",
    )
