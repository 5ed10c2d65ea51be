"""The command of the live page: `monitor`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from observer_rt.cli.options import (
    BenchOption,
    EffectsOption,
    FromChannelOption,
    InjectorOption,
    LenientOption,
    file_option,
)
from observer_rt.config.bench import EXAMPLE_BENCH, load_bench

messages = Console(stderr=True)


def monitor(
    bench: BenchOption = EXAMPLE_BENCH,
    injector: InjectorOption = None,
    log: Annotated[
        Path | None, file_option("--log", "CAN log with inputs and results, instead of the buses.")
    ] = None,
    from_channel: FromChannelOption = None,
    speed: Annotated[float, typer.Option(help="Of a log: 1 = real time.", min=0.01, max=1000.0)] = 1.0,
    port: Annotated[int, typer.Option(help="Of the page; 0 = any that is free.", min=0, max=65535)] = 5006,
    address: Annotated[
        str,
        typer.Option(
            help="Where the page is served: this computer only, unless an address that others reach is given."
        ),
    ] = "127.0.0.1",
    out: Annotated[
        Path, typer.Option("--out", help="Folder that `Save` writes injections into.", metavar="DIR")
    ] = Path("injections"),
    lenient: LenientOption = False,
    effects: EffectsOption = None,
) -> None:
    """Serve a live page of a bench: last injections, masses, wear, states and what to do. Listens, sends nothing."""
    from observer_rt.watch.server import MonitorOptions
    from observer_rt.watch.server import monitor as serve

    chosen = load_bench(bench, lenient=lenient).of(injector)
    serve(chosen, MonitorOptions(log, tuple(from_channel or ()), speed, address, port, out), messages)
