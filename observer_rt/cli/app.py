"""The command line: thin commands, errors as messages and exit codes.

Exit codes: 0 there is a result, 1 failed at run time or `check` found an error, 2 the command line or a file the
user supplied must change.
"""

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer
from rich.console import Console

from observer_rt import __version__
from observer_rt.cli.discover import discover
from observer_rt.cli.effects import effects
from observer_rt.cli.logs import convert, record, replay
from observer_rt.cli.options import (
    BenchOption,
    EffectsOption,
    FromChannelOption,
    FuelTemperatureOption,
    JsonOption,
    LenientOption,
    ModelOption,
    StateOption,
)
from observer_rt.cli.reproduce import reproduce
from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR
from observer_rt.foundation.errors import ObserverError, UserError
from observer_rt.terminal.console import results, say

if TYPE_CHECKING:
    from observer_rt.config.bench import Bench

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # units in brackets are not markup
    help="Estimates the injection rate of a common-rail injector in real time, from CAN back onto CAN.",
)
messages = Console(stderr=True)


def main() -> None:
    """Entry point of `observer-rt`."""
    try:
        try:
            app()
        finally:
            sys.stdout.flush()  # so that what cannot be written shows here
    except ObserverError as error:
        _fail(str(error), error.exit_code)
    except BrokenPipeError:
        _abandon_stdout()
        sys.exit(1)
    except MemoryError:
        _fail("not enough memory\n  remedy: cut the recording, or sample it slower", 1)
    except OSError as error:
        _abandon_stdout()
        _fail(f"{error.filename or 'output'}: {error.strerror or error}", 1)


def _abandon_stdout() -> None:
    """Let the interpreter's own last flush succeed: what could not be written has been reported."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _fail(message: str, exit_code: int) -> NoReturn:
    messages.print("[red]error:[/red]", end=" ")
    say(messages, message)
    sys.exit(exit_code)


def _version(show: bool) -> None:
    if show:
        print(f"observer-rt {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


@app.command(epilog="Example: observer-rt demo --wear 0.3 --figure demo.png")
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


@app.command(epilog="Example: observer-rt run --bench bench.toml --state learned.json --view")
def run(
    bench: Annotated[Path | None, typer.Option("--bench", help="Bench file.", metavar="FILE")] = None,
    state: Annotated[
        Path | None,
        typer.Option(
            "--state", help="Learned state: restored at start, saved at a clean stop.", metavar="FILE"
        ),
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Show the live terminal view.")] = False,
    lenient: LenientOption = False,
    print_example_bench: Annotated[
        bool, typer.Option("--print-example-bench", help="Print a complete, commented bench file.")
    ] = False,
    print_example_injector: Annotated[
        bool, typer.Option("--print-example-injector", help="Print a complete, commented injector file.")
    ] = False,
    effects: EffectsOption = None,
) -> None:
    """Run the daemon: frames in, injection rate out, until SIGINT or SIGTERM."""
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
    from observer_rt.service.run import serve

    serve(_load(bench, lenient=lenient), state, view, messages)


@app.command(
    epilog="Example: observer-rt simulate --rail-pressure 60,100,140 --energizing-time 0.6,1.9 --injections 12 "
    "--effect orifice_area:v_H=0.3 --output worn.csv"
)
def simulate(
    output: Annotated[
        Path, typer.Option("--output", help="Recording to write (.csv, .mf4).", metavar="FILE")
    ],
    rail_pressure: Annotated[
        str, typer.Option("--rail-pressure", help="MPa, comma separated; event i takes number i mod n.")
    ] = "100",
    energizing_time: Annotated[
        str, typer.Option("--energizing-time", help="ms, comma separated; event i takes number i mod m.")
    ] = "1.9",
    injections: Annotated[int, typer.Option("--injections", help="Number of events.", min=1)] = 10,
    period: Annotated[float, typer.Option("--period", help="From event to event [ms].", min=1.0)] = 60.0,
    sample_rate: Annotated[float, typer.Option("--sample-rate", help="Hz.", min=1.0)] = 100e3,
    shots: Annotated[
        str | None,
        typer.Option("--shots", help="Shots of every event as duration@offset [ms], e.g. 0.3@-1.5,1.0@0."),
    ] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option("--effect", help="Deviation of the plant, id[:parameter]=value; repeatable."),
    ] = None,
    noise: Annotated[
        str, typer.Option("--noise", help="on: noise and 16-bit quantisation; off: none.")
    ] = "on",
    measured_rate: Annotated[
        bool, typer.Option("--measured-rate", help="Add a measured injection rate with its errors.")
    ] = False,
    seed: Annotated[int, typer.Option("--seed", help="Seed of the noise.", min=0)] = 0,
    fuel_temperature: FuelTemperatureOption = None,
    model: Annotated[
        Path,
        typer.Option(
            "--model",
            help="Injector file (default: the nominal injector).",
            metavar="FILE",
            show_default=False,
        ),
    ] = NOMINAL_INJECTOR,
    effects: EffectsOption = None,
) -> None:
    """Simulate a healthy or worn injector; the truth goes to FILE.truth.csv, which the observer never reads."""
    from observer_rt.simulation.command import simulate_to_file

    simulate_to_file(
        output=output,
        model=model,
        rail_pressure=rail_pressure,
        energizing_time=energizing_time,
        injections=injections,
        period_ms=period,
        sample_rate=sample_rate,
        shots=shots,
        effects=effect or [],
        noise=noise,
        measured_rate=measured_rate,
        seed=seed,
        console=messages,
        fuel_temperature=fuel_temperature,
    )


@app.command(epilog="Example: observer-rt evaluate worn.csv --output trace.csv --plot worn.png")
def evaluate(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            help="Recordings (.csv, .mf4) or CAN logs (.blf, .asc, .log, .trc, .mf4).",
            metavar="RECORDING",
            show_default=False,
        ),
    ],
    bench: BenchOption = EXAMPLE_BENCH,
    model: ModelOption = None,
    state: StateOption = None,
    save_state: Annotated[
        Path | None, typer.Option("--save-state", help="Where to save what was learned.", metavar="FILE")
    ] = None,
    no_learning: Annotated[
        bool, typer.Option("--no-learning", help="Keep phi as it is at the start.")
    ] = False,
    chain: Annotated[
        bool, typer.Option("--chain", help="The recordings are one history: learning goes on.")
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option("--output", help="Trace, one row per sample; a folder for several.", metavar="FILE|DIR"),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Figure (png, svg, pdf).", metavar="FILE")
    ] = None,
    from_channel: FromChannelOption = None,
    fuel_temperature: FuelTemperatureOption = None,
    lenient: LenientOption = False,
    as_json: JsonOption = False,
    effects: EffectsOption = None,
) -> None:
    """Run recordings through the observer, exactly as the daemon would, as fast as the machine allows."""
    from observer_rt.evaluation.command import EvaluateOptions, evaluate_files

    evaluate_files(
        _load(bench, model, lenient),
        recordings,
        EvaluateOptions(
            state,
            save_state,
            not no_learning,
            chain,
            output,
            plot,
            as_json,
            from_channel or (),
            fuel_temperature,
        ),
        messages,
    )


@app.command(epilog="Example: observer-rt check --bench bench.toml --state learned.json")
def check(
    bench: BenchOption = EXAMPLE_BENCH,
    model: ModelOption = None,
    state: StateOption = None,
    log: Annotated[
        Path | None,
        typer.Option("--log", help="CAN log of the bench: losses, jitter, noise.", metavar="FILE"),
    ] = None,
    from_channel: FromChannelOption = None,
    lenient: LenientOption = False,
    as_json: JsonOption = False,
    effects: EffectsOption = None,
) -> None:
    """Check configuration, bus database, substeps, bus load and real-time rights, without touching the bus."""
    from observer_rt.check.checkup import Level, as_json_document, as_table, checkup
    from observer_rt.check.log import log_findings

    chosen = _load(bench, model, lenient)
    findings = checkup(chosen, state)
    if log is not None:
        findings += log_findings(chosen, log, from_channel or ())
    if as_json:
        print(json.dumps(as_json_document(findings), indent=2))
    else:
        results().print(as_table(findings))
    if any(finding.level is Level.ERROR for finding in findings):
        raise typer.Exit(1)


app.command(epilog="Example: observer-rt replay recording.csv --bench bench.toml --speed 0.1")(replay)
app.command(epilog="Example: observer-rt record --bench bench.toml --out bus.blf --rotate-size 500")(record)
app.command(epilog="Example: observer-rt convert bus.blf recording.csv --bench bench.toml")(convert)
app.command(epilog="Example: observer-rt discover --model injector.toml --out found worn_1.csv worn_2.csv")(
    discover
)
app.command(epilog="Example: observer-rt effects --effects my_effects.py")(effects)
app.command(epilog="Example: observer-rt reproduce --out reproduced")(reproduce)


def _load(path: Path, model: Path | None = None, lenient: bool = False) -> "Bench":
    from observer_rt.config.bench import load_bench

    return load_bench(path, model, lenient)
