"""The command `batch` of `tools/bench`."""

import json
from typing import Annotated

import typer
from rich.console import Console

from tools.benchmarks.many.measure import FULL, QUICK, measure_many
from tools.benchmarks.many.report import many_document, print_many
from tools.benchmarks.screen import screen
from tools.benchmarks.speed.document import finite

EXAMPLE = "Examples: tools/bench batch; tools/bench batch --quick --json"
TABLE_WIDTH = 150  # where stdout is no terminal
messages = Console(stderr=True)


def batch(
    quick: Annotated[bool, typer.Option("--quick", help="Few and short files: a look, no verdict.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="JSON on stdout.")] = False,
) -> None:
    """What many recordings cost through `observer-rt batch`, beside the compiled core alone."""
    found = measure_many(
        QUICK if quick else FULL, lambda text: messages.print(f"{text} ...", highlight=False)
    )
    if as_json:
        print(json.dumps(finite(many_document(found)), indent=2))
    else:
        print_many(found, screen(TABLE_WIDTH))
