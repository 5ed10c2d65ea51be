"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

BenchOption = Annotated[
    Path,
    typer.Option(
        "--bench",
        help="Bench file (default: the example bench of the package).",
        metavar="FILE",
        show_default=False,
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
