"""The command `fit`."""

from functools import partial
from pathlib import Path
from typing import Annotated

from rich.console import Console

from observer_rt.cli.options import (
    DecoderOption,
    EffectsOption,
    ForceOption,
    FromChannelOption,
    InjectorOption,
    JsonOption,
    LenientOption,
    RecordingsArgument,
    file_option,
)


def fit(
    recordings: RecordingsArgument,
    model: Annotated[
        Path,
        file_option(
            "--model", "Injector file to start from: geometry right, the rest within a factor of two."
        ),
    ],
    output: Annotated[Path, file_option("--output", "Fitted injector file to write.")],
    mass: Annotated[
        Path | None,
        file_option(
            "--mass",
            "Measured masses (CSV: recording,mass_mg[,injection][,sigma_mg]), which fix the absolute level.",
        ),
    ] = None,
    plot: Annotated[
        Path | None, file_option("--plot", "Figure (png, svg, pdf): line pressure and residuals by phase.")
    ] = None,
    force: ForceOption = False,
    bench: DecoderOption = None,
    from_channel: FromChannelOption = None,
    injector: InjectorOption = None,
    lenient: LenientOption = False,
    as_json: JsonOption = False,
    effects: EffectsOption = None,
) -> None:
    """Calibrate the model, its structure included, to recordings of the healthy injector."""
    from observer_rt.cli.decoder import decoder_of
    from observer_rt.config.channels import effects_on_one_raster
    from observer_rt.evaluation.sources import open_source, without_truths
    from observer_rt.fit.command import FitOptions, fit_files

    decoder = decoder_of(bench, injector, lenient, model)
    messages = Console(stderr=True)
    read = partial(open_source, bench=decoder, from_channels=from_channel or (), console=messages)
    options = FitOptions(model, output, mass, plot, as_json, force)
    stated = () if decoder is None else effects_on_one_raster(decoder.injector)
    fit_files(without_truths(recordings, messages), options, messages, read, stated)
