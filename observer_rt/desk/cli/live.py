"""Commands of the live observer: `demo`, `run`, `check`, `monitor` and `journal`."""

import json
import math
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, Bench, describes_files_only, load_bench
from observer_rt.desk.cli import options
from observer_rt.desk.cli.options import Standing, Writes, argument, file_option, messages, option
from observer_rt.foundation.console import FIGURE_SUFFIXES, results, say
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.outputs import check_output

SHOWN = 10  # injections of a journal in a table
LOOP_SPEED = 0.2  # of the demonstration of a missing effect, 1: real time


def demo(
    wear: Annotated[
        float, option("--wear", "Nozzle wear v_H: relative change of the orifice flow.", min=-0.5, max=0.5)
    ] = 0.3,
    injections: Annotated[int, option("--injections", "Number of injections.", min=3, max=100)] = 12,
    speed: Annotated[float, option("--speed", "Replay speed, 1 = real time.", min=0.01, max=1.0)] = 0.05,
    seed: Annotated[int, option("--seed", "Seed of the measurement noise.", min=0)] = 1,
    figure: Annotated[
        Path, file_option("--figure", "Where to write the picture (png, svg, pdf)."), Writes("picture")
    ] = Path("observer_rt_demo.png"),
    missing_effect: Annotated[
        bool,
        option(
            "--missing-effect",
            "Instead: an injector with an effect that no model has, drawn by --seed. The daemon refuses, what is "
            "missing is found and taken over, and injections are valid again.",
        ),
    ] = False,
    outside: Annotated[
        bool, option("--outside", "With --missing-effect: one that is in no vocabulary, but a law.")
    ] = False,
    out: Annotated[
        Path,
        option("--out", "With --missing-effect: folder of bench, evidence and report, new or empty.", "DIR"),
        Writes("bench, injector, log, journal, evidence and report", Standing.EMPTY),
    ] = Path("observer_rt_demo"),
    force: options.ForceOption = False,
) -> None:
    """Watch a worn injector being learned: simulated, sent as CAN FD frames, estimated by the daemon."""
    from observer_rt.daemon.view import draw
    from observer_rt.desk.cli.demo import Demo, mass_table, write_figure

    check_output("--figure", figure, force, suffixes=FIGURE_SUFFIXES)
    if missing_effect:
        _demo_of_loop(seed, outside, out, figure)
        return
    say(messages, f"simulating {injections} injections of an injector with v_H = {wear:+.2f} ...")
    scene = Demo(wear, injections, seed)
    say(
        messages,
        f"replaying them as CAN FD frames over {scene.link.interface} {scene.link.channel} at {speed:g} times real "
        "time; the observer knows the nominal injector only",
    )
    result = scene.run(speed, partial(draw, console=messages) if messages.is_terminal else None)
    write_figure(result, wear, figure)
    results().print(mass_table(result))
    say(messages, f"picture: {figure}")


def _demo_of_loop(seed: int, outside: bool, out: Path, figure: Path) -> None:
    from observer_rt.desk.cli.effect_demo import (
        EffectDemo,
        hidden_effect,
        loop_table,
        make_empty,
        write_loop_figure,
    )

    make_empty(out)
    hidden = hidden_effect(seed, outside)
    say(messages, f"hidden: {hidden.words}; the observer knows the nominal injector only")
    result = EffectDemo(out, hidden, seed, LOOP_SPEED, lambda text: say(messages, text)).run()
    write_loop_figure(result, figure)
    results().print(loop_table(result))
    say(messages, f"picture: {figure}; what was found, and why: {result.report}")


def run(
    bench: Annotated[
        Path | None, file_option("--bench", "Bench file; required unless an example is printed.")
    ] = None,
    state: Annotated[
        Path | None,
        file_option(
            "--state",
            "File of the learned state: restored at the start, saved every few seconds "
            "([state] save_within_s, 5 s) and at the stop.",
        ),
        Writes(
            "learned state, one that does not fit set aside as `*.set-aside-N`", Standing.OWN, ("*.lock",)
        ),
    ] = None,
    journal: Annotated[
        Path | None,
        file_option(
            "--journal",
            "SQLite file with one row per injection, saved as often as the state; see `observer-rt journal`.",
        ),
        Writes("journal of injections", Standing.OWN),
    ] = None,
    view: Annotated[bool, option("--view", "Show the live terminal view.")] = False,
    as_json: Annotated[bool, option("--json", "Write every injection as a line of JSON to stdout.")] = False,
    log: Annotated[
        Path | None,
        file_option("--log", "Also append the log to this file."),
        Writes("lines of the log", Standing.OWN),
    ] = None,
    injector: options.InjectorOption = None,
    lenient: options.LenientOption = False,
    print_example_bench: Annotated[
        bool, option("--print-example-bench", "Print a complete, commented bench file.")
    ] = False,
    print_example_injector: Annotated[
        bool, option("--print-example-injector", "Print a complete, commented injector file.")
    ] = False,
) -> None:
    """Run the daemon of all injectors of a bench: frames in, injection rate out, until SIGINT or SIGTERM."""
    for wanted, path in ((print_example_bench, EXAMPLE_BENCH), (print_example_injector, NOMINAL_INJECTOR)):
        if wanted:
            print(path.read_text(encoding="utf-8"), end="")
            return
    if bench is None:
        raise UserError(
            "--bench",
            "is missing",
            "give a bench file; `observer-rt run --print-example-bench > bench.toml` makes one to start from",
        )
    from observer_rt.daemon.run import RunOptions, refuse_shared, serve
    from observer_rt.desk.check.checkup import refuse_errors

    asked = RunOptions(state, view, as_json, log, journal)

    def read() -> Bench:
        chosen = load_bench(bench, lenient=lenient).of(injector)
        refuse_shared(chosen, asked)
        refuse_errors(chosen, state, journal)
        return chosen

    serve(read(), asked, messages, read)


def check(
    bench: options.BenchOption = EXAMPLE_BENCH,
    model: options.ModelOption = None,
    state: Annotated[Path | None, file_option("--state", "Learned state to check: can it be used?")] = None,
    log: Annotated[Path | None, file_option("--log", "CAN log to check: losses, jitter, noise.")] = None,
    from_channel: options.FromChannelOption = None,
    recording: Annotated[
        Path | None, file_option("--recording", "Recording to check: columns, units, rate, gaps, ranges.")
    ] = None,
    injector: options.InjectorOption = None,
    lenient: options.LenientOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Check configuration, bus database, substeps, bus load and real-time rights, without touching the bus."""
    from observer_rt.desk.check.checkup import (
        Level,
        as_json_document,
        as_table,
        checkup,
        log_findings,
        of_each,
        recording_findings,
    )

    is_alone = bench == EXAMPLE_BENCH and model is None and state is None
    is_layout = recording is not None and (is_alone or describes_files_only(bench))
    chosen = load_bench(bench, model, lenient, off_bus=is_layout).of(injector)
    findings = [] if is_layout else checkup(chosen, state)
    if log is not None:
        channels = from_channel or ()
        findings += of_each(chosen, lambda alone: log_findings(alone, log, channels))
    if recording is not None:
        findings += recording_findings(chosen, recording)
    if as_json:
        print(json.dumps(as_json_document(findings), indent=2))
    else:
        results().print(as_table(findings))
    if any(finding.level is Level.ERROR for finding in findings):
        raise typer.Exit(1)


def monitor(
    bench: options.BenchOption = EXAMPLE_BENCH,
    injector: options.InjectorOption = None,
    log: Annotated[
        Path | None, file_option("--log", "Show a CAN log with inputs and results instead of the buses.")
    ] = None,
    from_channel: options.FromChannelOption = None,
    speed: Annotated[float, option("--speed", "Speed of a log; 1 = real time.", min=0.01, max=1000.0)] = 1.0,
    start: Annotated[float, option("--start", "Begin at this time of a log [s].", min=0.0)] = 0.0,
    stop: Annotated[float | None, option("--stop", "End at this time of a log [s].", min=0.0)] = None,
    port: Annotated[int, option("--port", "Port of the page; 0 = any free one.", min=0, max=65535)] = 5006,
    address: Annotated[
        str,
        option(
            "--address",
            "Address to serve the page at. The default can be reached from this computer only.",
        ),
    ] = "127.0.0.1",
    out: Annotated[
        Path,
        option("--out", "Folder that `Save` writes injections into.", "DIR"),
        Writes("an injection at each `Save`: CSV and JSON", Standing.FREE),
    ] = Path("injections"),
    lenient: options.LenientOption = False,
) -> None:
    """Serve a live page of a bench: last injections, masses, wear, states and what to do. Listens, sends nothing."""
    if find_spec("tornado") is None:
        raise UserError(
            "monitor", "needs Tornado, which is not installed", "pip install 'observer-rt[monitor]'"
        )
    from observer_rt.desk.live_page.server import serve_page
    from observer_rt.desk.live_page.watching import LiveSource, LogSource

    def read() -> Bench:
        return load_bench(bench, lenient=lenient).of(injector)

    chosen = read()
    source = (
        LiveSource(chosen)
        if log is None
        else LogSource(
            log,
            chosen.config.buses,
            tuple(from_channel or ()),
            speed,
            (start, math.inf if stop is None else stop),
        )
    )
    serve_page(chosen, source, address, port, out, messages, read)


def take_over(
    amended: Annotated[
        Path | None, argument("Amended injector file that `discover` wrote.", "AMENDED")
    ] = None,
    bench: Annotated[
        Path | None,
        file_option("--bench", "Bench file that is to name it."),
        Writes("the name of a copy of AMENDED, which gets the next free name", Standing.KEY),
    ] = None,
    undo: Annotated[
        bool, option("--undo", "Instead: have the bench file name what it named before the last step.")
    ] = False,
    accept_changes: Annotated[
        bool,
        option(
            "--accept-changes",
            "Take it over although it also changes parameters that the file in force states otherwise.",
        ),
    ] = False,
    injector: options.InjectorOption = None,
) -> None:
    """Have a bench use an amended model, or undo that; the daemon that serves it reads it between two injections."""
    from observer_rt.desk import take_over as taking

    if bench is None:
        raise UserError("--bench", "is missing", "name the bench file that the daemon serves")
    if (amended is None) != undo:
        raise UserError(
            "AMENDED",
            "is missing" if amended is None else "and --undo exclude each other",
            "give one of them",
        )
    try:
        done = (
            taking.undo(bench, injector or "")
            if amended is None
            else taking.take_over(bench, injector or "", amended, accept_changes)
        )
    except taking.UnacceptedChangesError as error:
        raise UserError(error.place, error.problem, f"{error.remedy} by --accept-changes") from None
    before, after = done.step.before or "the nominal injector", done.step.after
    say(results(), f"{bench}: {after} -> {before}" if undo else f"{bench}: {before} -> {done.step.as_text}")
    for change in done.changes:
        say(results(), f"  {change}")
    if done.has_daemon:
        say(messages, "the daemon has it in force")
    else:
        say(
            messages,
            "no daemon is found by evidence or state that this bench file names: "
            "one that serves it all the same reads it at SIGUSR1",
        )


def journal(
    file: Annotated[Path, argument("Journal that `observer-rt run --journal` wrote or writes.", "FILE")],
    last: Annotated[
        int | None, option("--last", f"Show the last N injections only (table: {SHOWN}).", "N", min=1)
    ] = None,
    as_csv: Annotated[bool, option("--csv", "Injections as CSV on stdout.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Show a journal of injections: the last ones, and the wear over time; also while it is written."""
    from observer_rt.daemon.persistence.journal import (
        print_csv,
        print_json,
        print_tables,
        reading_journal,
    )

    if as_csv and as_json:
        raise UserError("--csv", "and --json are two forms of the same", "leave one of them out")
    with reading_journal(file) as content:
        if as_csv:
            print_csv(content, last)
        elif as_json:
            print_json(content, last)
        else:
            print_tables(content, last or SHOWN)
