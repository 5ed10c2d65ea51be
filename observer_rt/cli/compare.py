"""The command `compare`."""

import json
from pathlib import Path
from typing import Annotated

import typer

from observer_rt.cli.options import JsonOption
from observer_rt.foundation.errors import UserError


def compare(
    runs: Annotated[
        list[Path],
        typer.Argument(help="Folders that `discover --out` wrote.", metavar="DIR", show_default=False),
    ],
    as_json: JsonOption = False,
) -> None:
    """Put runs of `discover` side by side: verdicts, sizes, gaps; what changed from the first to the last."""
    from observer_rt.discovery import runs as comparison
    from observer_rt.terminal.console import results, say

    if len(runs) < 2:
        raise UserError("DIR", "is one run", "name two folders or more")
    found = [comparison.Run.read(path) for path in runs]
    if as_json:
        print(json.dumps(comparison.as_json(found), indent=2))
        return
    console = results()
    console.print(comparison.run_table(found))
    for line in comparison.change_lines(found):
        say(console, line)
