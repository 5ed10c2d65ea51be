"""The command `discover`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from observer_rt.cli_options import JsonOption
from observer_rt.config import NOMINAL_INJECTOR


def discover(
    recordings: Annotated[
        list[Path],
        typer.Argument(help="Recordings (.csv, .mf4).", metavar="RECORDING", show_default=False),
    ],
    out: Annotated[
        Path, typer.Option("--out", help="Folder for findings, amended model and report.", metavar="DIR")
    ],
    model: Annotated[
        Path,
        typer.Option(
            "--model",
            help="Injector file (default: the nominal injector).",
            metavar="FILE",
            show_default=False,
        ),
    ] = NOMINAL_INJECTOR,
    healthy: Annotated[
        list[Path] | None,
        typer.Option(
            "--healthy",
            help="Recording of a healthy injector to judge the model by; repeatable.",
            metavar="RECORDING",
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Find the physical effect the model is missing, its size and how sure that is; write the amended model."""
    from observer_rt.discovery.command import DiscoverOptions, discover_files
    from observer_rt.evaluation.second_opinion import second_opinion

    options = DiscoverOptions(model, out, tuple(healthy or ()), as_json)
    discover_files(recordings, options, second_opinion, Console(stderr=True))
