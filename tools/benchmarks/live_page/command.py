"""The command `monitor` of `tools/bench`."""

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from tools.benchmarks.command_line import JsonOption, put_out
from tools.benchmarks.live_page.measure import measure_page
from tools.benchmarks.live_page.report import page_document, page_table

EXAMPLE = "Examples: tools/bench monitor; tools/bench monitor --injectors 3 --seconds 20"
TABLE_WIDTH = 120  # where stdout is no terminal


def monitor(
    seconds: Annotated[float, typer.Option(min=1.0, help="How long each page is watched.")] = 60.0,
    injectors: Annotated[int, typer.Option(min=1, max=8, help="Side by side, each on a bus.")] = 1,
    as_json: JsonOption = False,
) -> None:
    """How smoothly the live page is drawn in a real browser, beside a bare page; exit code 1 where it is not."""
    with tempfile.TemporaryDirectory(prefix="monitor-") as folder:
        found = measure_page(Path(folder), seconds, injectors)
    put_out(
        as_json,
        lambda: page_document(found),
        lambda console: console.print(page_table(found)),
        TABLE_WIDTH,
    )
    if not found.is_met:
        raise typer.Exit(1)
