"""Commands that need no bus: `simulate`, `evaluate`, `batch`, `trend` and `reproduce`."""

from functools import partial
from json import dumps
from pathlib import Path
from typing import Annotated

from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, load_bench, load_injector
from observer_rt.desk.cli.command import messages
from observer_rt.desk.recording_options import SIGNALS, EvaluateOptions
from observer_rt.foundation.console import progress_bar, results, say
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import write_text
from observer_rt.foundation.options import Argument, BenchFile, Force, Injector, Json, Model, Option, State
from observer_rt.foundation.outputs import FIGURE_SUFFIXES, REPRODUCTION, check_output, make_folder
from observer_rt.foundation.units import MICROMETRE, MICROSECOND, MILLISECOND

MAX_SAMPLES = 20_000_000  # of a simulation, that a machine of 4 GiB can hold with their truth


def simulate(
    output: Annotated[Path, Option(f"Recording to write ({SIGNALS}).")],
    rail_pressure: Annotated[str, Option("Rail pressures [MPa], separated by commas; events take them in turn.")] = (
        "100"
    ),
    energizing_time: Annotated[
        str, Option("Energizing times [ms], separated by commas; events take them in turn.")
    ] = "1.9",
    injections: Annotated[int, Option("Number of events.", minimum=1)] = 10,
    period: Annotated[float, Option("Time from event to event [ms].", minimum=1.0)] = 60.0,
    sample_rate: Annotated[float, Option("Samples a second [Hz].", minimum=1.0)] = 100e3,
    shots: Annotated[str | None, Option("Shots of every event as duration@offset [ms], e.g. 0.3@-1.5,1.0@0.")] = None,
    effect: Annotated[
        tuple[str, ...],
        Option(
            "Effect in the simulated injector, ID[:PARAMETER]=VALUE, "
            "in the unit that `observer-rt effects` lists; repeatable.",
            "EFFECT",
        ),
    ] = (),
    noise: Annotated[str, Option("on: noise and 16-bit quantisation; off: none.", "on|off")] = "on",
    measured_rate: Annotated[bool, Option("Add a measured injection rate with its errors.")] = False,
    energizing: Annotated[bool, Option("Add a column that is 1 while the injector is energized.")] = False,
    no_lift: Annotated[bool, Option("Leave out the needle lift, as most benches must: energizing stands for it.")] = (
        False
    ),
    jitter: Annotated[
        float, Option("By which the needle answers energizing later or earlier, one sigma [us].", minimum=0.0)
    ] = 0.0,
    bounce: Annotated[float, Option("Lift of the needle after it landed [um].", minimum=0.0, maximum=200.0)] = 0.0,
    seed: Annotated[int, Option("Seed of the noise.", minimum=0)] = 0,
    model: Annotated[Path, Option("Injector file (default: the nominal injector).")] = NOMINAL_INJECTOR,
    force: Force = False,
) -> None:
    """Simulate a healthy or worn injector; the truth goes to FILE.truth.csv, which the observer never reads."""
    from observer_rt.desk.simulation import schedule as times
    from observer_rt.desk.simulation import simulate as simulation
    from observer_rt.files.formats import SIGNALS_WRITTEN, write_recording

    if noise not in ("on", "off"):
        raise UserError("--noise", f"is {noise!r}", "give on or off")
    truth = simulation.truth_path(output)
    check_output("--output", output, force, suffixes=SIGNALS_WRITTEN)
    check_output("--output", truth, force)
    spacing = period * MILLISECOND
    samples = injections * spacing * sample_rate
    if samples > MAX_SAMPLES:
        raise UserError(
            "--injections",
            f"{injections} events every {period:g} ms at {sample_rate:g} Hz are {samples:.3g} samples "
            f"(at most {MAX_SAMPLES:.3g})",
            "write several recordings; `evaluate --chain` takes them as one history",
        )
    schedule = times.make_schedule(
        times.parse_rail_pressures(rail_pressure),
        injections,
        spacing,
        times.parse_energizing_times(energizing_time),
        times.parse_shots(shots) if shots else (),
    )
    parameters = load_injector(model)
    deviations = simulation.parse_effects(effect)
    added = simulation.SimulatedNoise() if noise == "on" else None
    with progress_bar(messages, "simulating", 1.0) as progress:
        made = simulation.simulate(
            parameters, schedule, sample_rate, deviations, added, measured_rate, seed, progress, bounce * MICROMETRE
        )
    recording = made.recording
    if energizing or no_lift:
        level = times.energized(schedule, recording.time, jitter * MICROSECOND, seed)
        recording = recording.with_arrays({"energizing": level})
    if no_lift:
        recording = recording.without_lift()
    write_recording(output, recording)
    simulation.write_truth(truth, made.truth)
    effects = "; ".join((*parameters.in_force, *map(simulation.sizes_of, deviations))) or "no effect"
    count = f"{made.recording.samples} samples at {sample_rate:g} Hz, {injections} events"
    say(messages, f"{output}: {count}, {effects}; truth in {truth.name}")


def evaluate(options: EvaluateOptions) -> None:
    """Run recordings through the observer, as the daemon would and as fast as the machine allows."""
    from observer_rt.desk.evaluation.histories import evaluate_files

    evaluate_files(load_bench(options.bench, options.model, off_bus=True).of(options.injector), options, messages)


def reproduce(out: Annotated[Path, Option("Folder for figures and table.", "DIR")], force: Force = False) -> None:
    """Reproduce the paper's Figs. 3-5, its scheme and ours side by side, with a table."""
    from observer_rt.desk.paper.figures import draw_figure_3, draw_figure_4, draw_figure_5
    from observer_rt.desk.paper.study import NOZZLE_WEAR, run_study
    from observer_rt.desk.paper.table import csv_table, screen_table

    make_folder("--out", out)
    figures = [out / f"figure_{number}.png" for number in (3, 4, 5)]
    table = out / "table.csv"
    for path in figures:
        check_output("--out", path, force, suffixes=FIGURE_SUFFIXES)
    check_output("--out", table, force, REPRODUCTION)
    with progress_bar(messages, "reproducing", 1.0) as progress:
        study = run_study(load_bench().exact, progress)
    draw_figure_3(figures[0], study)
    draw_figure_4(figures[1], study.case(NOZZLE_WEAR))
    draw_figure_5(figures[2], study)
    write_text(table, csv_table(study))
    results().print(screen_table(study))
    say(messages, f"figures 3 to 5 and table in {out}")


def batch(
    sources: Annotated[
        tuple[str, ...], Argument("Files, folders (all below them) or patterns such as 'run_*/**/*.mf4'.", "SOURCE")
    ],
    out: Annotated[
        Path, Option("Folder for the tables (Parquet); recordings that are in them are not evaluated again.", "DIR")
    ],
    bench: BenchFile = EXAMPLE_BENCH,
    model: Model = None,
    injector: Injector = None,
    injector_from: Annotated[
        str | None,
        Option("Regular expression whose first group finds an injector's name in a file's path.", "PATTERN"),
    ] = None,
    scheduler: Annotated[
        str | None, Option("Address of a Dask scheduler (default: workers on this computer).", "ADDRESS")
    ] = None,
    workers: Annotated[int | None, Option("Processes on this computer (default: one per CPU).", minimum=1)] = None,
    state: State = None,
    no_learning: Annotated[bool, Option("Judge injections without learning from them.")] = False,
    json: Json = False,
) -> None:
    """Evaluate thousands of recordings in parallel: a table with one row per injection, resumed where it stopped."""
    from observer_rt.desk.evaluation.histories import starting_knowledge
    from observer_rt.desk.fleet.batch import Dataset, dask_client, evaluate_all, print_counts, settings_of
    from observer_rt.desk.fleet.job import Task
    from observer_rt.desk.fleet.recordings import INJECTOR_FROM, PathPattern, recordings_in
    from observer_rt.foundation.stop_request import stop_on_signals

    chosen = load_bench(bench.absolute(), model and model.absolute(), off_bus=True).of(injector)
    names = None if injector_from is None else PathPattern.read(INJECTOR_FROM, injector_from)
    paths = recordings_in(sources)
    make_folder("--out", out)
    learning = not no_learning
    knowledge = starting_knowledge("--state", state, chosen.injector.parameters, partial(say, messages))
    dataset = Dataset(out, settings_of(chosen, state, learning, injector_from))
    task = Task(chosen, Path.cwd(), knowledge, learning, names)
    with stop_on_signals() as stop, dask_client(scheduler, workers) as client:
        counts = evaluate_all(client, stop, task, paths, dataset, messages)
    print_counts(dataset, counts, json, messages)


def trend(
    results_of: Annotated[Path, Argument("Folder that `batch` filled.", "DIR")],
    limit: Annotated[
        tuple[str, ...],
        Option("Change whose date is asked: nozzle=30%, seat=-20%, closes_later=100us; repeatable.", "QUANTITY=SIZE"),
    ] = (),
    time_from: Annotated[
        str | None,
        Option("Regular expression whose first group finds date and time of a recording in its path.", "PATTERN"),
    ] = None,
    plot: Annotated[Path | None, Option("Figure (png, svg, pdf): courses of the most worn injectors.")] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Show wear and needle of every injector over dates, the most worn first, and when they reach limits."""
    from observer_rt.desk.fleet.batch import read_injections
    from observer_rt.desk.fleet.recordings import TIME_FROM, PathPattern
    from observer_rt.desk.fleet.trend import NEEDED, Limit, as_json, needle_table_of, table_of, trends

    if plot is not None:
        check_output("--plot", plot, force, suffixes=FIGURE_SUFFIXES)
    limits = [Limit.read(text) for text in limit]
    dates = None if time_from is None else PathPattern.read(TIME_FROM, time_from)
    made = trends(read_injections(results_of, NEEDED), dates)
    if json:
        print(dumps(as_json(made, limits), indent=2))
    else:
        results().print(table_of(made, limits))
        if (needle := needle_table_of(made)) is not None:
            results().print(needle)
    if plot is not None:
        from observer_rt.desk.fleet.trend_figure import draw

        draw(plot, made, limits)
        say(messages, f"{plot}: figure")
