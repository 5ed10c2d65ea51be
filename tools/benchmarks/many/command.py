"""The command `batch` of `tools/bench`."""

from typing import Annotated

import typer

from tools.benchmarks.command_line import JsonOption, finite, messages, put_out
from tools.benchmarks.many.measure import FULL, QUICK, measure_many
from tools.benchmarks.many.report import many_document, print_many

EXAMPLE = "Examples: tools/bench batch; tools/bench batch --quick --json"
TABLE_WIDTH = 150  # where stdout is no terminal


def batch(
    quick: Annotated[bool, typer.Option("--quick", help="Few and short files: a look, no verdict.")] = False,
    as_json: JsonOption = False,
) -> None:
    """What many recordings cost through `observer-rt batch`, beside the compiled core alone."""
    found = measure_many(
        QUICK if quick else FULL, lambda text: messages.print(f"{text} ...", highlight=False)
    )
    put_out(
        as_json,
        lambda: finite(many_document(found)),
        lambda console: print_many(found, console),
        TABLE_WIDTH,
    )
