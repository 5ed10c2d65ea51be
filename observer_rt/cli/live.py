"""Commands of the live observer: `demo`, `run` and `check`."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from observer_rt.cli.options import (
    BenchOption,
    EffectsOption,
    FromChannelOption,
    InjectorOption,
    JsonOption,
    LenientOption,
    ModelOption,
    file_option,
)
from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, load_bench
from observer_rt.foundation.errors import UserError
from observer_rt.terminal.console import results

messages = Console(stderr=True)


def demo(
    wear: Annotated[
        float, typer.Option(help="Nozzle wear v_H: relative change of the orifice flow.", min=-0.5, max=0.5)
    ] = 0.3,
    injections: Annotated[int, typer.Option(help="How many injections.", min=3, max=100)] = 12,
    speed: Annotated[float, typer.Option(help="Replay speed, 1 = real time.", min=0.01, max=1.0)] = 0.05,
    seed: Annotated[int, typer.Option(help="Seed of the measurement noise.", min=0)] = 1,
    figure: Annotated[
        Path, typer.Option(help="Where to write the picture (png, svg, pdf).", metavar="FILE")
    ] = Path("observer_rt_demo.png"),
) -> None:
    """Watch a worn injector being learned: simulated, sent as CAN FD frames, estimated by the daemon."""
    from observer_rt.cli.demo import run_demo

    run_demo(wear, injections, speed, seed, figure, messages)


def run(
    bench: Annotated[
        Path | None, file_option("--bench", "Bench file; needed, unless an example is printed.")
    ] = None,
    state: Annotated[
        Path | None,
        file_option(
            "--state",
            "Learned state: restored at start, saved at the stop and, while running, within "
            "[state] save_within_s of the bench file (5 s).",
        ),
    ] = None,
    journal: Annotated[
        Path | None,
        file_option(
            "--journal", "SQLite file for a row an injection, written as soon: see `observer-rt journal`."
        ),
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Show the live terminal view.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Every injection as a line of JSON on stdout.")
    ] = False,
    log: Annotated[Path | None, file_option("--log", "File that log lines are appended to, too.")] = None,
    injector: InjectorOption = None,
    lenient: LenientOption = False,
    print_example_bench: Annotated[
        bool, typer.Option("--print-example-bench", help="Print a complete, commented bench file.")
    ] = False,
    print_example_injector: Annotated[
        bool, typer.Option("--print-example-injector", help="Print a complete, commented injector file.")
    ] = False,
    effects: EffectsOption = None,
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
    from observer_rt.check.buses import refuse_errors
    from observer_rt.service.run import RunOptions, serve

    chosen = load_bench(bench, lenient=lenient).of(injector)
    refuse_errors(chosen)
    serve(chosen, RunOptions(state, view, as_json, log, journal), messages)


def check(
    bench: BenchOption = EXAMPLE_BENCH,
    model: ModelOption = None,
    state: Annotated[Path | None, file_option("--state", "Learned state: what would become of it.")] = None,
    log: Annotated[Path | None, file_option("--log", "CAN log of the bench: losses, jitter, noise.")] = None,
    from_channel: FromChannelOption = None,
    recording: Annotated[
        Path | None, file_option("--recording", "Recording: columns, units, rate, gaps, ranges.")
    ] = None,
    injector: InjectorOption = None,
    lenient: LenientOption = False,
    as_json: JsonOption = False,
    effects: EffectsOption = None,
) -> None:
    """Check configuration, bus database, substeps, bus load and real-time rights, without touching the bus."""
    from observer_rt.check.checkup import Level, as_json_document, as_table, checkup, of_each
    from observer_rt.check.log import log_findings
    from observer_rt.check.recording import recording_findings

    chosen = load_bench(bench, model, lenient).of(injector)
    findings = checkup(chosen, state)
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
