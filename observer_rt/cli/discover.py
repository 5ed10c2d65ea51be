"""The command `discover`."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from observer_rt.cli.options import (
    DecoderOption,
    EffectsOption,
    FromChannelOption,
    InjectorOption,
    JsonOption,
    LenientOption,
    RecordingsArgument,
    file_option,
)
from observer_rt.config.bench import NOMINAL_INJECTOR


def discover(
    recordings: RecordingsArgument,
    out: Annotated[
        Path, typer.Option("--out", help="Folder for findings, amended model and report.", metavar="DIR")
    ],
    model: Annotated[
        Path | None,
        file_option(
            "--model",
            "Injector file (default: the bench file's, else the nominal injector).",
            show_default=False,
        ),
    ] = None,
    healthy: Annotated[
        list[Path] | None,
        typer.Option(
            "--healthy",
            help="Recording of a healthy injector to judge the model by; repeatable.",
            metavar="RECORDING",
        ),
    ] = None,
    choose: Annotated[
        str,
        typer.Option(
            "--choose",
            help="Effect to put into the amended model where several explain the recordings as well; two as ID+ID.",
            metavar="ID",
            show_default=False,
        ),
    ] = "",
    force: Annotated[
        bool, typer.Option("--force", help="Replace the report and the amended model that stand in DIR.")
    ] = False,
    data: Annotated[
        bool, typer.Option("--data", help="Also write the figures (SVG) and the numbers behind them (CSV).")
    ] = False,
    bench: DecoderOption = None,
    from_channel: FromChannelOption = None,
    injector: InjectorOption = None,
    lenient: LenientOption = False,
    as_json: JsonOption = False,
    effects: EffectsOption = None,
) -> None:
    """Find the physical effect the model is missing, its size and how sure that is; write the amended model."""
    from observer_rt.cli.decoder import decoder_of
    from observer_rt.config.channels import effects_on_one_raster
    from observer_rt.discovery.command import DiscoverOptions, discover_files
    from observer_rt.evaluation.second_opinion import second_opinion
    from observer_rt.evaluation.sources import open_source, without_truths

    decoder = decoder_of(bench, injector, lenient, model)
    messages = Console(stderr=True)
    read = partial(open_source, bench=decoder, from_channels=from_channel or (), console=messages)
    start = model or (NOMINAL_INJECTOR if decoder is None else decoder.injector.parameters_path)
    options = DiscoverOptions(start, out, tuple(healthy or ()), as_json, choose, force, data)
    stated = () if decoder is None else effects_on_one_raster(decoder.injector)
    ask = partial(second_opinion, signals=None if decoder is None else decoder.injector.config.signals)
    discover_files(without_truths(recordings, messages), options, ask, messages, read, stated)
