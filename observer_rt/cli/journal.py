"""The command `journal`."""

from pathlib import Path
from typing import Annotated

import typer

from observer_rt.cli.options import JsonOption
from observer_rt.foundation.errors import UserError

SHOWN = 10  # injections in a table


def journal(
    file: Annotated[
        Path, typer.Argument(help="Journal that `observer-rt run --journal` wrote or writes.", metavar="FILE")
    ],
    last: Annotated[
        int | None,
        typer.Option("--last", help=f"Only so many injections (of the table: {SHOWN}).", metavar="N", min=1),
    ] = None,
    as_csv: Annotated[bool, typer.Option("--csv", help="Injections as CSV on stdout.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Show a journal of injections: the last ones, and the wear over time; also while it is written."""
    from observer_rt.service.keeping.journal_reading import (
        print_csv,
        print_json,
        print_tables,
        reading_journal,
    )

    if as_csv and as_json:
        raise UserError("--csv", "and --json are two forms of the same", "leave one of them out")
    with reading_journal(file) as content:
        if as_csv:
            print_csv(content, last)
        elif as_json:
            print_json(content, last)
        else:
            print_tables(content, last or SHOWN)
