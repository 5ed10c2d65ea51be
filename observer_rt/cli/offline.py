"""Commands that need no bus: `simulate` and `evaluate`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from observer_rt.cli.options import (
    SIGNALS,
    BenchOption,
    EffectsOption,
    ForceOption,
    FromChannelOption,
    FuelTemperatureOption,
    InjectorOption,
    JsonOption,
    LenientOption,
    ModelOption,
    RecordingsArgument,
    StateOption,
    file_option,
)
from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, load_bench

messages = Console(stderr=True)


def simulate(
    output: Annotated[Path, file_option("--output", f"Recording to write ({SIGNALS}).")],
    rail_pressure: Annotated[
        str,
        typer.Option("--rail-pressure", help="Rail pressures [MPa] by commas, taken in turn by the events."),
    ] = "100",
    energizing_time: Annotated[
        str, typer.Option("--energizing-time", help="Energizing times [ms] by commas, taken in turn as well.")
    ] = "1.9",
    injections: Annotated[int, typer.Option("--injections", help="Number of events.", min=1)] = 10,
    period: Annotated[float, typer.Option("--period", help="From event to event [ms].", min=1.0)] = 60.0,
    sample_rate: Annotated[
        float, typer.Option("--sample-rate", help="Samples a second [Hz].", min=1.0)
    ] = 100e3,
    shots: Annotated[
        str | None,
        typer.Option("--shots", help="Shots of every event as duration@offset [ms], e.g. 0.3@-1.5,1.0@0."),
    ] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            help="Deviation of the plant, ID[:PARAMETER]=VALUE, in the unit that `observer-rt effects` states; "
            "repeatable.",
            metavar="EFFECT",
        ),
    ] = None,
    noise: Annotated[
        str, typer.Option("--noise", help="on: noise and 16-bit quantisation; off: none.", metavar="on|off")
    ] = "on",
    measured_rate: Annotated[
        bool, typer.Option("--measured-rate", help="Add a measured injection rate with its errors.")
    ] = False,
    seed: Annotated[int, typer.Option("--seed", help="Seed of the noise.", min=0)] = 0,
    fuel_temperature: FuelTemperatureOption = None,
    model: Annotated[
        Path, file_option("--model", "Injector file (default: the nominal injector).", show_default=False)
    ] = NOMINAL_INJECTOR,
    force: ForceOption = False,
    effects: EffectsOption = None,
) -> None:
    """Simulate a healthy or worn injector; the truth goes to FILE.truth.csv, which the observer never reads."""
    from observer_rt.simulation.command import SimulateOptions, simulate_to_file

    simulate_to_file(
        output,
        SimulateOptions(
            model=model,
            rail_pressure=rail_pressure,
            energizing_time=energizing_time,
            injections=injections,
            period_ms=period,
            sample_rate=sample_rate,
            shots=shots,
            effects=effect or (),
            noise=noise,
            measured_rate=measured_rate,
            seed=seed,
            fuel_temperature=fuel_temperature,
            force=force,
        ),
        messages,
    )


def evaluate(
    recordings: RecordingsArgument,
    bench: BenchOption = EXAMPLE_BENCH,
    model: ModelOption = None,
    state: StateOption = None,
    save_state: Annotated[Path | None, file_option("--save-state", "Where to save what was learned.")] = None,
    no_learning: Annotated[
        bool, typer.Option("--no-learning", help="Keep the model as it is at the start.")
    ] = False,
    chain: Annotated[
        bool, typer.Option("--chain", help="The recordings are one history: learning goes on.")
    ] = False,
    output: Annotated[
        Path | None,
        file_option(
            "--output", "Trace, one row a sample (.csv, .mf4, .parquet); a folder for several.", "FILE|DIR"
        ),
    ] = None,
    plot: Annotated[
        Path | None, file_option("--plot", "Figure (png, svg, pdf): curves, masses, wear.")
    ] = None,
    injections: Annotated[
        str | None,
        typer.Option(
            "--injections", help="Numbers of those drawn as curves, as 1,5-8 (default: first, middle, last)."
        ),
    ] = None,
    from_channel: FromChannelOption = None,
    fuel_temperature: FuelTemperatureOption = None,
    injector: InjectorOption = None,
    lenient: LenientOption = False,
    force: ForceOption = False,
    as_json: JsonOption = False,
    effects: EffectsOption = None,
) -> None:
    """Run recordings through the observer, exactly as the daemon would, as fast as the machine allows."""
    from observer_rt.evaluation.command import EvaluateOptions
    from observer_rt.evaluation.curves import chosen_numbers
    from observer_rt.evaluation.several import evaluate_bench

    options = EvaluateOptions(
        state=state,
        save_state=save_state,
        learning=not no_learning,
        chain=chain,
        output=output,
        plot=plot,
        json=as_json,
        from_channel=from_channel or (),
        force=force,
        fuel_temperature=fuel_temperature,
        injections=chosen_numbers(injections) if injections is not None else (),
    )
    evaluate_bench(load_bench(bench, model, lenient).of(injector), recordings, options, messages)
