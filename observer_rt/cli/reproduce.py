"""The command `reproduce`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console


def reproduce(
    out: Annotated[Path, typer.Option("--out", help="Folder for figures, table and report.", metavar="DIR")],
    sample_rate: Annotated[
        float, typer.Option("--sample-rate", help="Samples a second [Hz].", min=1.0)
    ] = 100e3,
) -> None:
    """Reproduce the paper's Figs. 3-5, its scheme and ours side by side, with a table and a report."""
    from observer_rt.paper.command import reproduce_into

    reproduce_into(out, sample_rate, Console(stderr=True))
