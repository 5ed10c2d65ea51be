"""The command `wave-recordings` of `tools/bench`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from observer_rt.foundation.errors import UserError
from observer_rt.terminal.console import progress_bar
from tools.benchmarks.plant import record
from tools.benchmarks.wave_plant import Variant
from tools.benchmarks.wave_recordings import faulty_bench, healthy_benches, parsed_faults, write_recordings

EXAMPLE = "Example: tools/bench wave-recordings --out build/plain; observer-rt fit build/plain/*ms.csv ..."


def wave_recordings(
    out: Annotated[Path, typer.Option(help="Folder for the recordings and their truth.")],
    variant: Annotated[Variant, typer.Option(help="What the line is like.")] = Variant.PLAIN,
    fault: Annotated[
        list[str] | None,
        typer.Option(help="NAME=VALUE (SI; may be repeated): one recording of 20 events with it, instead."),
    ] = None,
    rate: Annotated[float, typer.Option(help="Sample rate [kHz], a divisor of 100.")] = 100.0,
    averaged: Annotated[
        bool, typer.Option("--averaged", help="Samples are means over the sample period that ends there.")
    ] = False,
    measured_rate: Annotated[
        bool,
        typer.Option(
            "--measured-rate", help="With a measured rate; the injector file's inertance is 5 % wrong."
        ),
    ] = False,
    seed: Annotated[int, typer.Option(help="Master seed.")] = 1,
) -> None:
    """Six healthy recordings of an injector on a line with travelling waves, as `fit` wants them."""
    if 100.0 % rate:
        raise UserError("--rate", f"{rate:g} kHz is no divisor of 100", "give 100, 50, 20 or 10")
    hz = 1e3 * rate
    if fault:
        benches = {"_".join(fault): faulty_bench(variant, seed, parsed_faults(fault), hz, averaged)}
    else:
        benches = healthy_benches(variant, seed, hz, averaged)
    outcomes = ((name, record(bench)) for name, bench in benches.items())
    messages = Console(stderr=True)
    with progress_bar(messages, "recording", float(len(benches))) as progress:
        for number, path in enumerate(write_recordings(out, outcomes, measured_rate), 1):
            progress(float(number))
            messages.print(f"{path}, truth beside it", highlight=False, soft_wrap=True)
