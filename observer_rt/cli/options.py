"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer


def _use_effects(paths: list[Path] | None) -> None:
    """The vocabulary of this command: installed effects are in it without the option."""
    from observer_rt.config.own_effects import use_effects

    use_effects(paths or ())


BenchOption = Annotated[
    Path,
    typer.Option(
        "--bench",
        help="Bench file (default: the example bench of the package).",
        metavar="FILE",
        show_default=False,
    ),
]
EffectsOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--effects",
        help="Python file with effects of your own, as in docs/effects.md; repeatable.",
        metavar="FILE",
        callback=_use_effects,
        is_eager=True,  # before any injector file is read
        expose_value=False,
    ),
]
FuelTemperatureOption = Annotated[
    float | None,
    typer.Option(
        "--fuel-temperature", help="Of the fuel [degC] (default: reference_temperature of the injector file)."
    ),
]
LenientOption = Annotated[
    bool, typer.Option("--lenient", help="Read bus databases although signals overlap or do not fit.")
]
ModelOption = Annotated[
    Path | None, typer.Option("--model", help="Injector file, instead of the bench's.", metavar="FILE")
]
StateOption = Annotated[
    Path | None, typer.Option("--state", help="Learned state to start from.", metavar="FILE")
]
FromChannelOption = Annotated[
    list[str] | None,
    typer.Option(
        "--from-channel",
        help="Channel of a CAN log, where the inputs are on several; of a bus of [links] as LINK=CHANNEL.",
        metavar="[LINK=]CHANNEL",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Results as JSON on stdout.")]
