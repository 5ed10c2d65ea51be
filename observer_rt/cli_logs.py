"""Commands on CAN logs: `record` and `convert`."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from observer_rt.cli_options import BenchOption, FromChannelOption, JsonOption
from observer_rt.config import EXAMPLE_BENCH

MEGABYTE = 1_000_000
messages = Console(stderr=True)


def record(
    out: Annotated[Path, typer.Option("--out", help="Log to write (.blf, .log).", metavar="FILE")],
    bench: BenchOption = EXAMPLE_BENCH,
    channel: Annotated[
        str | None, typer.Option("--channel", help="CAN channel, instead of the bench's.")
    ] = None,
    interface: Annotated[
        str | None, typer.Option("--interface", help="python-can interface, instead of the bench's.")
    ] = None,
    duration: Annotated[
        float | None, typer.Option("--duration", help="End after this time [s].", min=0.0)
    ] = None,
    frames: Annotated[int | None, typer.Option("--frames", help="End after so many frames.", min=1)] = None,
    rotate_size: Annotated[
        float | None, typer.Option("--rotate-size", help="Begin a new file at this size [MB].", min=0.001)
    ] = None,
    rotate_time: Annotated[
        float | None, typer.Option("--rotate-time", help="Begin a new file after this time [s].", min=0.001)
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that are there already.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Write every frame of a bus into a log, until stopped; how many were lost is noted in it."""
    from observer_rt.config import load_bench
    from observer_rt.recording.record_command import record_bus
    from observer_rt.recording.recorder import RecordLimits

    limits = RecordLimits(
        duration, frames, None if rotate_size is None else round(rotate_size * MEGABYTE), rotate_time
    )
    link = load_bench(bench).config.link.replaced(interface, channel)
    statistics = record_bus(link, out, limits, force, messages)
    print(json.dumps(statistics.as_json(), indent=2) if as_json else statistics.as_text())


def convert(
    source: Annotated[
        Path,
        typer.Argument(
            help="Recording (.csv, .mf4) or CAN log (.blf, .asc, .log, .trc, .mf4).",
            metavar="IN",
            show_default=False,
        ),
    ],
    target: Annotated[
        Path,
        typer.Argument(help="File to write, in the format of its suffix.", metavar="OUT", show_default=False),
    ],
    bench: Annotated[
        Path | None,
        typer.Option("--bench", help="Bench file by which a log becomes a recording.", metavar="FILE"),
    ] = None,
    from_channel: FromChannelOption = None,
    force: Annotated[bool, typer.Option("--force", help="Replace OUT if it is there already.")] = False,
) -> None:
    """Turn recordings and CAN logs into other formats, and logs, by a bench file, into recordings."""
    from observer_rt.config import load_bench
    from observer_rt.convert import convert as convert_file

    chosen = None if bench is None else load_bench(bench)
    print(convert_file(source, target, chosen, from_channel, force, messages))
