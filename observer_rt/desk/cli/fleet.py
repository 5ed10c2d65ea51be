"""Commands over many recordings: `batch` and `trend`."""

import json
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

from observer_rt.config.bench import EXAMPLE_BENCH, load_bench
from observer_rt.desk import options as shared
from observer_rt.desk.cli.command import messages
from observer_rt.foundation.console import FIGURE_SUFFIXES, results, say
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.options import Argument, Injector, Lenient, Option, Standing, Writes
from observer_rt.foundation.outputs import check_output, make_folder


@dataclass(frozen=True)
class BatchOptions:
    """Options of the command."""

    sources: Annotated[
        tuple[str, ...],
        Argument("Files, folders (all below them) or patterns such as 'run_*/**/*.mf4'.", "SOURCE"),
    ]
    out: Annotated[
        Path,
        Option(
            "Folder for the tables (Parquet), or a database NAME.duckdb; recordings that are in them are not "
            "evaluated again.",
            "DIR",
        ),
        Writes(
            "tables; marker: `batch.json`",
            Standing.MARKED,
            ("batch.json", "done.jsonl", "errors.jsonl", "errors.parquet", "injections"),
        ),
    ]
    bench: shared.BenchFile = EXAMPLE_BENCH
    model: shared.Model = None
    injector: Injector = None
    injector_from: Annotated[
        str | None,
        Option("Regular expression whose first group finds an injector's name in a file's path.", "PATTERN"),
    ] = None
    time_from: Annotated[
        str | None,
        Option(
            "Regular expression whose first group finds date and time of a recording in its path. "
            "Default: the time in frames, a column of calendar time, or the header; else when the file was last "
            "written, which `trend` does not take.",
            "PATTERN",
        ),
    ] = None
    age_from: Annotated[
        str | None,
        Option(
            "Column of the recordings with the injector's age: operating hours, or number of injections.",
            "COLUMN",
        ),
    ] = None
    scheduler: Annotated[
        str | None, Option("Address of a Dask scheduler (default: workers on this computer).", "ADDRESS")
    ] = None
    workers: Annotated[
        int | None, Option("Processes on this computer (default: one per CPU).", minimum=1)
    ] = None
    state: shared.State = None
    no_learning: Annotated[bool, Option("Judge injections without learning from them.")] = False
    lenient: Lenient = False
    discover: Annotated[
        bool, Option("Also find what the model is missing, injector by injector: DIR/discovered.")
    ] = False
    healthy: Annotated[
        tuple[Path, ...],
        Option(
            "With --discover: recording of a healthy injector to judge the model by; repeatable.", "RECORDING"
        ),
    ] = ()
    json: shared.Json = False


def batch(options: BatchOptions) -> None:
    """Evaluate thousands of recordings in parallel: a table with one row per injection, resumed where it stopped."""
    from observer_rt.desk.evaluation.learned_state import read_state
    from observer_rt.desk.fleet.batch import evaluate_all, settings_of, tell
    from observer_rt.desk.fleet.cluster import Work, connected
    from observer_rt.desk.fleet.database import SUFFIX, results_at
    from observer_rt.desk.fleet.groups import InjectorNames, RecordingTimes, doubt_of_one, recordings_in
    from observer_rt.desk.fleet.job import Task
    from observer_rt.foundation.console import stop_on_signals

    if options.healthy and not options.discover:
        raise UserError("--healthy", "is for discovery", "add --discover, or leave it out")
    out, pattern = options.out, options.injector_from
    is_database = out.suffix == SUFFIX
    if options.discover and is_database:
        raise UserError(f"--out {out}", "cannot hold the reports of --discover", "name a folder")
    model = options.model and options.model.absolute()
    benches = load_bench(options.bench.absolute(), model, options.lenient, off_bus=True)
    chosen = benches.of(options.injector)
    InjectorNames(pattern)  # refuses what is no pattern
    RecordingTimes(options.time_from)  # as this does
    asked = None
    if options.discover:  # loading what it needs takes as long as all else
        from observer_rt.desk.fleet.discovering import Discovering

        asked = Discovering.of(chosen, pattern, options.healthy)
    paths = recordings_in(options.sources)
    if doubt := doubt_of_one(paths, pattern, chosen):
        say(messages, doubt)
    make_folder("--out", out.parent if is_database else out)
    learning = not options.no_learning
    settings = settings_of(chosen, options.state, learning, pattern)
    columns = {"time_from": options.time_from, "age_from": options.age_from}
    dataset = results_at(out, settings | {key: each for key, each in columns.items() if each is not None})
    knowledge = read_state(options.state, chosen.injector.parameters, partial(say, messages))
    task = Task(chosen, Path.cwd(), knowledge, learning, pattern, options.time_from, options.age_from)
    found = None
    with dataset, stop_on_signals() as stop, connected(options.scheduler, options.workers) as cluster:
        work = Work(cluster, stop, messages)
        counts = evaluate_all(work, task, paths, dataset)
        if asked is not None:
            found = asked.of_groups(work, counts.paths, dataset)
    tell(dataset, counts, found, options.json, messages)


@dataclass(frozen=True)
class TrendOptions:
    """Options of the command."""

    results_of: Annotated[Path, Argument("Folder or database that `batch` filled.", "DIR")]
    limit: Annotated[
        tuple[str, ...],
        Option(
            "Change of flow whose date is asked, such as nozzle=30% or seat=-20%; repeatable.",
            "QUANTITY=SIZE",
        ),
    ] = ()
    time_from: Annotated[
        str | None,
        Option(
            "Regular expression whose first group finds date and time of a recording in its path.", "PATTERN"
        ),
    ] = None
    trust_file_times: Annotated[
        bool,
        Option(
            "Take the time at which a file was last written where nothing else says when it was recorded."
        ),
    ] = False
    out: Annotated[
        Path | None, Option("Page to write (default: trend.html in DIR, or beside it)."), Writes("page")
    ] = None
    plot: Annotated[Path | None, Option("Picture to write (.png, .svg, .pdf)."), Writes("picture")] = None
    force: shared.Force = False
    json: shared.Json = False


def trend(options: TrendOptions) -> None:
    """Show the wear of every injector over date and age, the most worn first, and when it reaches limits."""
    from observer_rt.desk.fleet.database import read_injections
    from observer_rt.desk.fleet.forecast import Limit
    from observer_rt.desk.fleet.trend import NEEDED, doubts, trends
    from observer_rt.desk.fleet.trend_page import write_page, write_picture
    from observer_rt.desk.fleet.trend_words import as_json as document
    from observer_rt.desk.fleet.trend_words import table_of

    folder, plot = options.results_of, options.plot
    page = options.out or (folder / "trend.html" if folder.is_dir() else folder.with_suffix(".html"))
    check_output("--out", page, options.force, suffixes=(".html",))
    if plot is not None:
        check_output("--plot", plot, options.force, suffixes=FIGURE_SUFFIXES)
    asked = [Limit.read(each) for each in options.limit]
    table = read_injections(folder, NEEDED)
    found = trends(table, asked, options.time_from, options.trust_file_times)
    write_page(page, found, folder)
    if plot is not None:
        write_picture(plot, found)
    if options.json:
        print(json.dumps(document(found), indent=2))
    else:
        results().print(table_of(found))
    for doubt in doubts(found):
        say(messages, doubt)
    say(messages, f"{len(found)} injector{'s' if len(found) != 1 else ''}: {page}")
