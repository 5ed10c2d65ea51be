"""Options of `observer-rt run`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from observer_rt.foundation.options import Injector, Option


@dataclass(frozen=True)
class RunOptions:
    """Options of the command."""

    bench: Annotated[Path | None, Option("Bench file; required unless an example is printed.")] = None
    state: Annotated[
        Path | None,
        Option(
            "File of the learned state: restored at the start, saved every few seconds "
            "([state] save_within_s, 5 s) and at the stop."
        ),
    ] = None
    journal: Annotated[
        Path | None, Option("SQLite file with one row per injection, saved as often as the state.")
    ] = None
    view: Annotated[bool, Option("Show the live terminal view.")] = False
    json: Annotated[bool, Option("Write every injection as a line of JSON to stdout.")] = False
    log: Annotated[Path | None, Option("Also append the log to this file.")] = None
    injector: Injector = None
    print_example_bench: Annotated[bool, Option("Print a complete, commented bench file.")] = False
    print_example_injector: Annotated[bool, Option("Print a complete, commented injector file.")] = False
