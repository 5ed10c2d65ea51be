"""Commands over many recordings: `batch` and `trend`."""

import json
from functools import partial
from pathlib import Path
from typing import Annotated

from observer_rt.config.bench import EXAMPLE_BENCH, load_bench
from observer_rt.desk.cli import options
from observer_rt.desk.cli.options import Standing, Writes, argument, file_option, messages, option
from observer_rt.foundation.console import FIGURE_SUFFIXES, results, say
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.outputs import check_output, make_folder


def batch(
    sources: Annotated[
        list[str], argument("Files, folders (all below them) or patterns such as 'run_*/**/*.mf4'.", "SOURCE")
    ],
    out: Annotated[
        Path,
        option(
            "--out",
            "Folder for the tables (Parquet), or a database NAME.duckdb; recordings that are in them are not "
            "evaluated again.",
            "DIR",
        ),
        Writes(
            "tables; marker: `batch.json`",
            Standing.MARKED,
            ("batch.json", "done.jsonl", "errors.jsonl", "errors.parquet", "injections"),
        ),
    ],
    bench: options.BenchOption = EXAMPLE_BENCH,
    model: options.ModelOption = None,
    injector: options.InjectorOption = None,
    injector_from: Annotated[
        str | None,
        option(
            "--injector-from",
            "Regular expression whose first group finds an injector's name in a file's path.",
            "PATTERN",
        ),
    ] = None,
    time_from: Annotated[
        str | None,
        option(
            "--time-from",
            "Regular expression whose first group finds date and time of a recording in its path. "
            "Default: the time in frames, a column of calendar time, or the header; else when the file was last "
            "written, which `trend` does not take.",
            "PATTERN",
        ),
    ] = None,
    age_from: Annotated[
        str | None,
        option(
            "--age-from",
            "Column of the recordings with the injector's age: operating hours, or number of injections.",
            "COLUMN",
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        option("--scheduler", "Address of a Dask scheduler (default: workers on this computer).", "ADDRESS"),
    ] = None,
    workers: Annotated[
        int | None, option("--workers", "Processes on this computer (default: one per CPU).", min=1)
    ] = None,
    state: options.StateOption = None,
    no_learning: Annotated[
        bool, option("--no-learning", "Judge injections without learning from them.")
    ] = False,
    lenient: options.LenientOption = False,
    discover: Annotated[
        bool,
        option("--discover", "Also find what the model is missing, injector by injector: DIR/discovered."),
    ] = False,
    healthy: Annotated[
        list[Path] | None,
        option(
            "--healthy",
            "With --discover: recording of a healthy injector to judge the model by; repeatable.",
            "RECORDING",
        ),
    ] = None,
    as_json: options.JsonOption = False,
) -> None:
    """Evaluate thousands of recordings in parallel: a table with one row per injection, resumed where it stopped."""
    from observer_rt.desk.evaluation.learned_state import read_state
    from observer_rt.desk.fleet.batch import evaluate_all, settings_of, tell
    from observer_rt.desk.fleet.cluster import Work, connected
    from observer_rt.desk.fleet.database import SUFFIX, results_at
    from observer_rt.desk.fleet.groups import InjectorNames, RecordingTimes, doubt_of_one, recordings_in
    from observer_rt.desk.fleet.job import Task
    from observer_rt.foundation.console import stop_on_signals

    if healthy and not discover:
        raise UserError("--healthy", "is for discovery", "add --discover, or leave it out")
    is_database = out.suffix == SUFFIX
    if discover and is_database:
        raise UserError(f"--out {out}", "cannot hold the reports of --discover", "name a folder")
    chosen = load_bench(bench.absolute(), model and model.absolute(), lenient, off_bus=True).of(injector)
    InjectorNames(injector_from)  # refuses what is no pattern
    RecordingTimes(time_from)  # as this does
    asked = None
    if discover:  # loading what it needs takes as long as all else
        from observer_rt.desk.fleet.discovering import Discovering

        asked = Discovering.of(chosen, injector_from, healthy or ())
    paths = recordings_in(sources)
    if doubt := doubt_of_one(paths, injector_from, chosen):
        say(messages, doubt)
    make_folder("--out", out.parent if is_database else out)
    learning = not no_learning
    settings = settings_of(chosen, state, learning, injector_from)
    columns = {"time_from": time_from, "age_from": age_from}
    dataset = results_at(out, settings | {key: each for key, each in columns.items() if each is not None})
    knowledge = read_state(state, chosen.injector.parameters, partial(say, messages))
    task = Task(chosen, Path.cwd(), knowledge, learning, injector_from, time_from, age_from)
    found = None
    with dataset, stop_on_signals() as stop, connected(scheduler, workers) as cluster:
        work = Work(cluster, stop, messages)
        counts = evaluate_all(work, task, paths, dataset)
        if asked is not None:
            found = asked.of_groups(work, counts.paths, dataset)
    tell(dataset, counts, found, as_json, messages)


def trend(
    results_of: Annotated[Path, argument("Folder or database that `batch` filled.", "DIR")],
    limits: Annotated[
        list[str] | None,
        option(
            "--limit",
            "Change of flow whose date is asked, such as nozzle=30% or seat=-20%; repeatable.",
            "QUANTITY=SIZE",
        ),
    ] = None,
    time_from: Annotated[
        str | None,
        option(
            "--time-from",
            "Regular expression whose first group finds date and time of a recording in its path.",
            "PATTERN",
        ),
    ] = None,
    trust_file_times: Annotated[
        bool,
        option(
            "--trust-file-times",
            "Take the time at which a file was last written where nothing else says when it was recorded.",
        ),
    ] = False,
    out: Annotated[
        Path | None,
        file_option("--out", "Page to write (default: trend.html in DIR, or beside it).", show_default=False),
        Writes("page"),
    ] = None,
    picture: Annotated[
        Path | None, file_option("--plot", "Picture to write (.png, .svg, .pdf)."), Writes("picture")
    ] = None,
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Show the wear of every injector over date and age, the most worn first, and when it reaches limits."""
    from observer_rt.desk.fleet.database import read_injections
    from observer_rt.desk.fleet.forecast import Limit
    from observer_rt.desk.fleet.trend import NEEDED, doubts, trends
    from observer_rt.desk.fleet.trend_page import write_page, write_picture
    from observer_rt.desk.fleet.trend_words import as_json as document
    from observer_rt.desk.fleet.trend_words import table_of

    page = out or (results_of / "trend.html" if results_of.is_dir() else results_of.with_suffix(".html"))
    check_output("--out", page, force, suffixes=(".html",))
    if picture is not None:
        check_output("--plot", picture, force, suffixes=FIGURE_SUFFIXES)
    asked = [Limit.read(each) for each in limits or ()]
    found = trends(read_injections(results_of, NEEDED), asked, time_from, trust_file_times)
    write_page(page, found, results_of)
    if picture is not None:
        write_picture(picture, found)
    if as_json:
        print(json.dumps(document(found), indent=2))
    else:
        results().print(table_of(found))
    for doubt in doubts(found):
        say(messages, doubt)
    say(messages, f"{len(found)} injector{'s' if len(found) != 1 else ''}: {page}")
