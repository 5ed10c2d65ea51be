"""Options that several commands at a desk share."""

from pathlib import Path
from typing import Annotated

from observer_rt.foundation.options import Option

BenchFile = Annotated[Path, Option("Bench file (default: the example bench of the package).")]
Decoder = Annotated[Path | None, Option("Bench file that says how to read CAN logs and files of your own layout.")]
Model = Annotated[Path | None, Option("Injector file, instead of the bench file's.")]
State = Annotated[Path | None, Option("Learned state to start from.")]
FromChannel = Annotated[
    tuple[str, ...],
    Option(
        "Channel with the inputs, where a CAN log has several; LINK=CHANNEL for one bus of [links].", "[LINK=]CHANNEL"
    ),
]
Force = Annotated[bool, Option("Replace existing files.")]
Json = Annotated[bool, Option("Results as JSON on stdout.")]
