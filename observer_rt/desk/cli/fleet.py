"""Commands over many recordings: `batch` and `trend`."""

from functools import partial
from json import dumps
from pathlib import Path
from typing import Annotated

from observer_rt.config.bench import EXAMPLE_BENCH, load_bench
from observer_rt.desk.cli.command import messages
from observer_rt.foundation.console import results, say
from observer_rt.foundation.options import Argument, BenchFile, Force, Injector, Json, Model, Option, State
from observer_rt.foundation.outputs import FIGURE_SUFFIXES, check_output, make_folder


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
    from observer_rt.desk.fleet.batch import dask_client, evaluate_all, print_counts, settings_of
    from observer_rt.desk.fleet.dataset import Dataset
    from observer_rt.desk.fleet.job import Task
    from observer_rt.desk.fleet.path_pattern import INJECTOR_FROM, PathPattern
    from observer_rt.desk.fleet.recordings import recordings_in
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
        Option("Change of flow whose date is asked, such as nozzle=30% or seat=-20%; repeatable.", "QUANTITY=SIZE"),
    ] = (),
    time_from: Annotated[
        str | None,
        Option("Regular expression whose first group finds date and time of a recording in its path.", "PATTERN"),
    ] = None,
    plot: Annotated[Path | None, Option("Figure (png, svg, pdf): courses of the most worn injectors.")] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Show the wear of every injector over dates, the most worn first, and when it reaches limits."""
    from observer_rt.desk.fleet.dataset import read_injections
    from observer_rt.desk.fleet.path_pattern import TIME_FROM, PathPattern
    from observer_rt.desk.fleet.trend import NEEDED, Limit, as_json, table_of, trends

    if plot is not None:
        check_output("--plot", plot, force, suffixes=FIGURE_SUFFIXES)
    limits = [Limit.read(text) for text in limit]
    dates = None if time_from is None else PathPattern.read(TIME_FROM, time_from)
    made = trends(read_injections(results_of, NEEDED), dates)
    if json:
        print(dumps(as_json(made, limits), indent=2))
    else:
        results().print(table_of(made, limits))
    if plot is not None:
        from observer_rt.desk.fleet.trend_figure import draw

        draw(plot, made, limits)
        say(messages, f"{plot}: figure")
