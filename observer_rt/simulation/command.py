"""`observer-rt simulate`: options to files."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from observer_rt.config import load_injector
from observer_rt.errors import UserError
from observer_rt.recording.files import write_recording
from observer_rt.screen import progress_bar
from observer_rt.simulation.effects import parse_effects
from observer_rt.simulation.measurement import NoiseLevels
from observer_rt.simulation.schedule import (
    make_schedule,
    parse_energizing_times,
    parse_rail_pressures,
    parse_shots,
)
from observer_rt.simulation.simulate import simulate, truth_path, write_truth
from observer_rt.units import MILLISECOND


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
) -> None:
    """Write a recording and, beside it, its truth. Raises `UserError` for options that make no sense."""
    if noise not in ("on", "off"):
        raise UserError("--noise", f"is {noise!r}", "give on or off")
    schedule = make_schedule(
        parse_rail_pressures(rail_pressure),
        injections,
        period_ms * MILLISECOND,
        parse_energizing_times(energizing_time),
        parse_shots(shots) if shots else (),
    )
    with progress_bar(console, "simulating", 1.0) as progress:
        simulation = simulate(
            load_injector(model),
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
    console.print(
        f"{output}: {simulation.recording.samples} samples at {sample_rate:g} Hz, {injections} events; "
        f"truth in {truth_path(output).name}",
        highlight=False,
    )
