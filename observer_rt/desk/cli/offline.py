"""Commands that need no bus: `simulate`, `evaluate` and `reproduce`."""

from pathlib import Path
from typing import Annotated

from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, load_bench, load_injector
from observer_rt.desk.cli import options
from observer_rt.desk.cli.options import SIGNALS, Standing, Writes, file_option, messages, option
from observer_rt.foundation.console import (
    FIGURE_SUFFIXES,
    progress_bar,
    results,
    say,
)
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.file_kinds import REPRODUCED
from observer_rt.foundation.outputs import check_output, make_folder, write_text
from observer_rt.foundation.units import MILLISECOND
from observer_rt.model.parameters import at_temperature, temperature_of

MAX_SAMPLES = 20_000_000  # of a simulation, that a machine of 4 GiB can hold with their truth
SampleRateOption = Annotated[float, option("--sample-rate", "Samples a second [Hz].", min=1.0)]


def simulate(
    output: Annotated[
        Path,
        file_option("--output", f"Recording to write ({SIGNALS})."),
        Writes("recording, its truth", names=("*.truth.csv",)),
    ],
    rail_pressure: Annotated[
        str, option("--rail-pressure", "Rail pressures [MPa], separated by commas; events take them in turn.")
    ] = "100",
    energizing_time: Annotated[
        str,
        option("--energizing-time", "Energizing times [ms], separated by commas; events take them in turn."),
    ] = "1.9",
    injections: Annotated[int, option("--injections", "Number of events.", min=1)] = 10,
    period: Annotated[float, option("--period", "Time from event to event [ms].", min=1.0)] = 60.0,
    sample_rate: SampleRateOption = 100e3,
    shots: Annotated[
        str | None, option("--shots", "Shots of every event as duration@offset [ms], e.g. 0.3@-1.5,1.0@0.")
    ] = None,
    effect: Annotated[
        list[str] | None,
        option(
            "--effect",
            "Effect in the simulated injector, ID[:PARAMETER]=VALUE, "
            "in the unit that `observer-rt effects` lists; repeatable.",
            "EFFECT",
        ),
    ] = None,
    noise: Annotated[
        str, option("--noise", "on: noise and 16-bit quantisation; off: none.", "on|off")
    ] = "on",
    measured_rate: Annotated[
        bool, option("--measured-rate", "Add a measured injection rate with its errors.")
    ] = False,
    seed: Annotated[int, option("--seed", "Seed of the noise.", min=0)] = 0,
    fuel_temperature: options.FuelTemperatureOption = None,
    model: Annotated[
        Path, file_option("--model", "Injector file (default: the nominal injector).", show_default=False)
    ] = NOMINAL_INJECTOR,
    force: options.ForceOption = False,
) -> None:
    """Simulate a healthy or worn injector; the truth goes to FILE.truth.csv, which the observer never reads."""
    from observer_rt.desk.simulation.schedule import (
        make_schedule,
        parse_energizing_times,
        parse_rail_pressures,
        parse_shots,
    )
    from observer_rt.desk.simulation.simulate import (
        SimulatedNoise,
        parse_effects,
        sizes_of,
        truth_path,
        write_truth,
    )
    from observer_rt.desk.simulation.simulate import simulate as simulated
    from observer_rt.files.formats import signal_formats, suffixes_of, write_recording, written

    if noise not in ("on", "off"):
        raise UserError("--noise", f"is {noise!r}", "give on or off")
    truth = truth_path(output)
    check_output("--output", output, force, suffixes=suffixes_of(written(signal_formats())))
    check_output("--output", truth, force)
    spacing = period * MILLISECOND
    samples = injections * spacing * sample_rate
    if samples > MAX_SAMPLES:
        raise UserError(
            "--injections",
            f"{injections} events every {period:g} ms at {sample_rate:g} Hz are {samples:.3g} "
            f"samples (at most {MAX_SAMPLES:.3g})",
            "write several recordings; `evaluate --chain` takes them as one history",
        )
    schedule = make_schedule(
        parse_rail_pressures(rail_pressure),
        injections,
        spacing,
        parse_energizing_times(energizing_time),
        parse_shots(shots) if shots else (),
    )
    parameters = load_injector(model)
    if fuel_temperature is not None:
        parameters = at_temperature(parameters, temperature_of("--fuel-temperature", fuel_temperature))
    deviations = parse_effects(effect or ())
    levels = SimulatedNoise() if noise == "on" else None
    with progress_bar(messages, "simulating", 1.0) as progress:
        simulation = simulated(
            parameters, schedule, sample_rate, deviations, levels, measured_rate, seed, progress
        )
    write_recording(output, simulation.recording)
    write_truth(truth, simulation.truth)
    say(
        messages,
        f"{output}: {simulation.recording.samples} samples at {sample_rate:g} Hz, {injections} events, "
        f"{'; '.join(map(sizes_of, deviations)) or 'no effect'}; truth in {truth.name}",
    )


def evaluate(
    recordings: options.RecordingsArgument,
    bench: options.BenchOption = EXAMPLE_BENCH,
    model: options.ModelOption = None,
    state: options.StateOption = None,
    save_state: Annotated[
        Path | None, file_option("--save-state", "File for what was learned."), Writes("learned state")
    ] = None,
    no_learning: Annotated[bool, option("--no-learning", "Keep the model as it is at the start.")] = False,
    twice: Annotated[
        bool,
        option(
            "--twice",
            "Look at every injection again with what all of them taught: rates, masses and wear of the first are "
            "as good as those of the last.",
        ),
    ] = False,
    chain: Annotated[
        bool, option("--chain", "Treat the recordings as one history: learning goes on from file to file.")
    ] = False,
    output: Annotated[
        Path | None,
        option(
            "--output", "Trace, one row a sample (.csv, .mf4, .parquet); a folder for several.", "FILE|DIR"
        ),
        Writes("trace; in a folder `RECORDING.trace.csv` for each"),
    ] = None,
    plot: Annotated[
        Path | None,
        file_option("--plot", "Figure (png, svg, pdf): curves, masses, wear."),
        Writes("figure"),
    ] = None,
    injections: Annotated[
        str | None,
        option("--injections", "Injections to draw as curves, such as 1,5-8 (default: first, middle, last)."),
    ] = None,
    from_channel: options.FromChannelOption = None,
    fuel_temperature: options.FuelTemperatureOption = None,
    injector: options.InjectorOption = None,
    lenient: options.LenientOption = False,
    yes: options.YesOption = False,
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Run recordings through the observer, as the daemon would and as fast as the machine allows; or --twice."""
    from observer_rt.desk.evaluation.command import EvaluateOptions, evaluate_bench
    from observer_rt.desk.evaluation.curves import chosen_numbers
    from observer_rt.desk.evaluation.guessing import as_confirmed

    asked = EvaluateOptions(
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
        twice=twice,
    )
    stated = load_bench(bench, model, lenient, off_bus=True).of(injector)
    evaluate_bench(as_confirmed(stated, recordings, yes, messages) or stated, recordings, asked, messages)


def reproduce(
    out: Annotated[
        Path,
        option("--out", "Folder for figures, table and report.", "DIR"),
        Writes(
            "figures, tables, report",
            Standing.NAMES,
            ("figure_3.png", "figure_4.png", "figure_5.png", "table.csv", "table.md", "report.md"),
        ),
    ],
    sample_rate: SampleRateOption = 100e3,
    force: options.ForceOption = False,
) -> None:
    """Reproduce the paper's Figs. 3-5, its scheme and ours side by side, with a table and a report."""
    from observer_rt.desk.paper.figures import draw_figure_3, draw_figure_4, draw_figure_5, report
    from observer_rt.desk.paper.study import NOZZLE_WEAR, run_study
    from observer_rt.desk.paper.table import csv_table, markdown, screen_table

    make_folder("--out", out)
    figures = [out / f"figure_{number}.png" for number in (3, 4, 5)]
    table, table_in_words, report_in_words = (out / name for name in ("table.csv", "table.md", "report.md"))
    for path in figures:
        check_output("--out", path, force, suffixes=FIGURE_SUFFIXES)
    for path in (table, table_in_words, report_in_words):
        check_output("--out", path, force, REPRODUCED)
    with progress_bar(messages, "reproducing", 1.0) as progress:
        study = run_study(load_bench(), sample_rate, progress)
    draw_figure_3(figures[0], study)
    draw_figure_4(figures[1], study.case(NOZZLE_WEAR))
    draw_figure_5(figures[2], study)
    write_text(table, csv_table(study))
    write_text(table_in_words, markdown(study))
    write_text(report_in_words, report(study))
    results().print(screen_table(study))
    say(messages, f"figures 3 to 5, table and report in {out}")
