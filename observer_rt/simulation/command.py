"""`observer-rt simulate`: options to files."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import load_injector
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MILLISECOND
from observer_rt.model.fuel import at_temperature, temperature_of
from observer_rt.recording.signals.files import WRITERS, write_recording
from observer_rt.simulation.effects import parse_effects
from observer_rt.simulation.measurement import NoiseLevels
from observer_rt.simulation.schedule import (
    make_schedule,
    parse_energizing_times,
    parse_rail_pressures,
    parse_shots,
)
from observer_rt.simulation.simulate import simulate, truth_path, write_truth
from observer_rt.terminal.console import progress_bar, say, say_if_compiling
from observer_rt.terminal.destinations import check_destination

MAX_SAMPLES = 20_000_000  # that a machine of 4 GiB can hold with their truth


def simulate_to_file(
    output: Path,
    model: Path,
    rail_pressure: str,
    energizing_time: str,
    injections: int,
    period_ms: float,
    sample_rate: float,
    shots: str | None,
    effects: Sequence[str],
    noise: str,
    measured_rate: bool,
    seed: int,
    console: Console,
    fuel_temperature: float | None = None,
) -> None:
    """Write a recording and, beside it, its truth; fuel_temperature: degC, None: as in the injector file.

    Raises `UserError` for options that make no sense.
    """
    if noise not in ("on", "off"):
        raise UserError("--noise", f"is {noise!r}", "give on or off")
    check_destination("--output", output, tuple(WRITERS))
    samples = injections * period_ms * MILLISECOND * sample_rate
    if samples > MAX_SAMPLES:
        raise UserError(
            "--injections",
            f"{injections} events every {period_ms:g} ms at {sample_rate:g} Hz are {samples:.3g} samples "
            f"(at most {MAX_SAMPLES:.3g})",
            "write several recordings; `evaluate --chain` takes them as one history",
        )
    schedule = make_schedule(
        parse_rail_pressures(rail_pressure),
        injections,
        period_ms * MILLISECOND,
        parse_energizing_times(energizing_time),
        parse_shots(shots) if shots else (),
    )
    injector = load_injector(model)
    if fuel_temperature is not None:
        injector = at_temperature(injector, temperature_of("--fuel-temperature", fuel_temperature))
    say_if_compiling(console)
    with progress_bar(console, "simulating", 1.0) as progress:
        simulation = simulate(
            injector,
            schedule,
            sample_rate,
            parse_effects(effects),
            NoiseLevels() if noise == "on" else None,
            measured_rate,
            seed,
            progress,
        )
    write_recording(output, simulation.recording)
    write_truth(truth_path(output), simulation.truth)
    say(
        console,
        f"{output}: {simulation.recording.samples} samples at {sample_rate:g} Hz, {injections} events; "
        f"truth in {truth_path(output).name}",
    )
