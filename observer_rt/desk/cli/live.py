"""Commands of the live observer: `demo`, `run`, `check` and `monitor`."""

from dataclasses import dataclass
from functools import partial
from json import dumps
from pathlib import Path
from typing import Annotated

import typer

from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, Bench, is_off_bus, load_bench
from observer_rt.config.toml_file import read_toml
from observer_rt.desk.cli.command import messages
from observer_rt.foundation.console import results, say
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.options import BenchFile, Force, FromChannel, Injector, Json, Model, Option, RunOptions
from observer_rt.foundation.outputs import FIGURE_SUFFIXES, check_output, make_folder


@dataclass(frozen=True)
class DemoOptions:
    """Options of `demo`."""

    wear: Annotated[
        float, Option("Nozzle wear v_H: relative change of the orifice flow.", minimum=-0.5, maximum=0.5)
    ] = 0.3
    injections: Annotated[int, Option("Number of injections.", minimum=3, maximum=100)] = 12
    speed: Annotated[float, Option("Replay speed, 1 = real time.", minimum=0.01, maximum=1.0)] = 0.1
    seed: Annotated[int, Option("Seed of the measurement noise.", minimum=0)] = 1
    figure: Annotated[Path, Option("Where to write the picture (png, svg, pdf).")] = Path("observer_rt_demo.png")
    missing_effect: Annotated[
        bool,
        Option(
            "Instead: an injector with an effect that no model has, drawn by --seed. The daemon refuses, what is "
            "missing is found and taken over, and injections are valid again."
        ),
    ] = False
    outside: Annotated[bool, Option("With --missing-effect: one that is in no vocabulary, but a law.")] = False
    out: Annotated[
        Path, Option("With --missing-effect: folder of bench, evidence and report, new or empty.", "DIR")
    ] = Path("observer_rt_demo")
    force: Force = False


def demo(options: DemoOptions) -> None:
    """Watch a worn injector being learned: simulated, sent as CAN FD frames, estimated by the daemon."""
    from observer_rt.daemon.view import draw
    from observer_rt.desk.demonstration.worn import Demo, mass_table, write_figure

    elsewhere = ("wear", "injections", "speed") if options.missing_effect else ("outside", "out")
    for name in elsewhere:
        if getattr(options, name) != getattr(DemoOptions, name):
            which = "without" if options.missing_effect else "with"
            raise UserError(f"--{name}", f"only counts {which} --missing-effect", "correct the command line")
    check_output("--figure", options.figure, options.force, suffixes=FIGURE_SUFFIXES)
    if options.missing_effect:
        _demo_of_loop(options)
        return
    wear, injections = options.wear, options.injections
    say(messages, f"simulating {injections} injections of an injector with v_H = {wear:+.2f} ...")
    scene = Demo(wear, injections, options.seed)
    on = f"{scene.link.interface} {scene.link.channel} at {options.speed:g} times real time"
    say(messages, f"replaying them as CAN FD frames over {on}; the observer knows the nominal injector only")
    result = scene.run(options.speed, partial(draw, console=messages) if messages.is_terminal else None)
    write_figure(result, wear, options.figure)
    results().print(mass_table(result))
    say(messages, f"picture: {options.figure}")


def _demo_of_loop(options: DemoOptions) -> None:
    from observer_rt.desk.demonstration import missing_effect as loop

    make_folder("--out", options.out)
    if any(options.out.iterdir()):
        raise UserError(f"--out {options.out}", "is not empty", "name another folder")
    hidden = loop.hidden_effect(options.seed, options.outside)
    say(messages, f"hidden: {hidden.words}; the observer knows the nominal injector only")
    result = loop.EffectDemo(options.out, hidden, options.seed, loop.SPEED, partial(say, messages)).run()
    loop.write_loop_figure(result, options.figure)
    results().print(loop.loop_table(result))
    say(messages, f"picture: {options.figure}; what was found, and why: {result.report}")


def run(options: RunOptions) -> None:
    """Run the daemon of an injector: frames in, injection rate out, until SIGINT or SIGTERM."""
    if options.print_example_bench or options.print_example_injector:
        example = EXAMPLE_BENCH if options.print_example_bench else NOMINAL_INJECTOR
        print(example.read_text(encoding="utf-8"), end="")
        return
    if (bench := options.bench) is None:
        remedy = "give a bench file; `observer-rt run --print-example-bench > bench.toml` makes one to start from"
        raise UserError("--bench", "is missing", remedy)
    from observer_rt.daemon.run import serve
    from observer_rt.desk.check.bench_rules import refuse_errors

    def read() -> Bench:
        all_injectors = load_bench(bench)
        refuse_errors(all_injectors, options.state, options.journal, options.injector)
        if not options.injector and len(all_injectors.injectors) > 1:
            names = [injector.name for injector in all_injectors.injectors]
            raise UserError(
                f"{bench}: injectors",
                f"the file has {len(names)}, a daemon observes one: {', '.join(names)}",
                f"`observer-rt run --injector {names[0]}` and so on, one process each; as services "
                f"`systemctl enable --now observer-rt@{names[0]}` and so on",
            )
        return all_injectors

    serve(read, options, messages)


def check(
    bench: BenchFile = EXAMPLE_BENCH,
    model: Model = None,
    state: Annotated[Path | None, Option("Learned state to check: can it be used?")] = None,
    log: Annotated[Path | None, Option("CAN log to check: losses, jitter, noise.")] = None,
    from_channel: FromChannel = (),
    recording: Annotated[Path | None, Option("Recording to check: columns, units, rate, gaps, ranges.")] = None,
    injector: Injector = None,
    json: Json = False,
) -> None:
    """Check configuration, bus database, substeps, bus load and real-time rights, without touching the bus."""
    from observer_rt.desk.check import given_files
    from observer_rt.desk.check.bench_rules import checkup, for_each_injector
    from observer_rt.desk.check.findings import Level, as_json_document, as_table

    is_alone = bench == EXAMPLE_BENCH and model is None and state is None
    is_layout = recording is not None and (is_alone or is_off_bus(read_toml(bench)))
    chosen = load_bench(bench, model, off_bus=is_layout).of(injector)
    findings = [] if is_layout else checkup(chosen, state)
    if log is not None:
        findings += for_each_injector(chosen, lambda alone: given_files.log_findings(alone, log, from_channel))
    if recording is not None:
        findings += given_files.recording_findings(chosen, recording)
    if json:
        print(dumps(as_json_document(findings), indent=2))
    else:
        results().print(as_table(findings))
    if any(finding.level is Level.ERROR for finding in findings):
        raise typer.Exit(1)


def monitor(
    bench: BenchFile = EXAMPLE_BENCH,
    injector: Injector = None,
    port: Annotated[int, Option("Port of the page; 0 = any free one.", minimum=0, maximum=65535)] = 5006,
    address: Annotated[
        str, Option("Address to serve the page at. The default can be reached from this computer only.")
    ] = "127.0.0.1",
    out: Annotated[Path, Option("Folder that `Save` writes injections into.", "DIR")] = Path("injections"),
) -> None:
    """Serve a live page of the daemons of a bench: last injections, masses, wear, states and what to do."""
    from observer_rt.desk.live_page.server import serve_page

    serve_page(load_bench(bench).of(injector), address, port, out, messages)
