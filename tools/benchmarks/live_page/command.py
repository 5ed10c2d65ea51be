"""The command `monitor` of `tools/bench`."""

import json
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from tools.benchmarks.live_page.measure import measure_page
from tools.benchmarks.live_page.report import page_document, page_table
from tools.benchmarks.screen import screen

EXAMPLE = "Examples: tools/bench monitor; tools/bench monitor --injectors 3 --seconds 20"
TABLE_WIDTH = 120  # where stdout is no terminal


def monitor(
    seconds: Annotated[float, typer.Option(min=1.0, help="How long each page is watched.")] = 60.0,
    injectors: Annotated[int, typer.Option(min=1, max=8, help="Side by side, each on a bus.")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="JSON on stdout.")] = False,
) -> None:
    """How smoothly the live page is drawn in a real browser, beside a bare page; exit code 1 where it is not."""
    with tempfile.TemporaryDirectory(prefix="monitor-") as folder:
        found = measure_page(Path(folder), seconds, injectors)
    if as_json:
        print(json.dumps(page_document(found), indent=2))
    else:
        screen(TABLE_WIDTH).print(page_table(found))
    if not found.is_met:
        raise typer.Exit(1)
