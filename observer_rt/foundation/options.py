"""Options of commands, said once: the annotated parameters of the function of each command.

A parameter `save_state` is `--save-state` on the command line. Those that several commands share stand here, and
those of `observer-rt run`, which the daemon is given as one object.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated


@dataclass(frozen=True)
class Option:
    """Declares a parameter as an option; metavar: its value's name. A default that `purpose` says is shown once."""

    purpose: str
    metavar: str | None = None
    minimum: float | None = None
    maximum: float | None = None


@dataclass(frozen=True)
class Argument:
    """Declares a parameter as given without an option."""

    purpose: str
    metavar: str


BenchFile = Annotated[Path, Option("Bench file (default: the example bench of the package).")]
Decoder = Annotated[Path | None, Option("Bench file that says how to read CAN logs and files of your own layout.")]
Model = Annotated[Path | None, Option("Injector file, instead of the bench file's.")]
Injector = Annotated[str | None, Option("Name of one injector, where the bench file has several.", "NAME")]
State = Annotated[Path | None, Option("Learned state to start from.")]
FromChannel = Annotated[
    tuple[str, ...],
    Option(
        "Channel with the inputs, where a CAN log has several; LINK=CHANNEL for one bus of [links].", "[LINK=]CHANNEL"
    ),
]
Force = Annotated[bool, Option("Replace existing files.")]
Json = Annotated[bool, Option("Results as JSON on stdout.")]


@dataclass(frozen=True)
class RunOptions:
    """Options of `observer-rt run`."""

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
