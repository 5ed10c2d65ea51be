"""Options that several commands share."""

from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from typer.models import ArgumentInfo, OptionInfo

from observer_rt.config.bench import Bench, load_bench
from observer_rt.files.canlog.can_log import LogFormat
from observer_rt.files.formats import BUILT_IN, formats, suffixes_of
from observer_rt.files.signals.signal_format import SignalFormat
from observer_rt.foundation.errors import UserError

try:
    _formats = formats()
except UserError:  # of an installed format, which the commands that read files tell
    _formats = BUILT_IN
_logs = [each for each in _formats if isinstance(each, LogFormat)]
SIGNALS = ", ".join(suffixes_of(each for each in _formats if isinstance(each, SignalFormat)))
LOGS = ", ".join(suffixes_of(_logs))
RECORDED = ", ".join(suffixes_of(each for each in _logs if each.recorder))
CLASSIC_ONLY = ", ".join(suffixes_of(each for each in _logs if not each.keeps_fd))

messages = Console(stderr=True)


def option(name: str, purpose: str, metavar: str | None = None, **limits: Any) -> OptionInfo:
    """An option; limits: further keywords of `typer.Option`."""
    found: OptionInfo = typer.Option(name, help=purpose, metavar=metavar, **limits)
    return found


def argument(purpose: str, metavar: str) -> ArgumentInfo:
    """What is given without an option."""
    found: ArgumentInfo = typer.Argument(help=purpose, metavar=metavar, show_default=False)
    return found


def file_option(name: str, purpose: str, **limits: Any) -> OptionInfo:
    """An option that names a file."""
    return option(name, purpose, "FILE", **limits)


def link_option(name: str, purpose: str) -> OptionInfo:
    """A repeatable option that says something of one bus of `[link]` or `[links]`."""
    return option(name, purpose, f"[LINK=]{name.rpartition('-')[2].upper()}")


class Standing(Enum):
    """What may be where a command writes: what it replaces, and what it refuses, as the page of commands says."""

    FILE = "with `--force`, a file of the same kind", "any other file"
    OWN = "nothing: goes on with its own file", "a file of another kind"
    NAMES = "with `--force`, files of these names and kinds", "any other file of these names"
    ANSWER = (
        "with `--force`, an earlier answer: a folder with `findings.json`",
        "any other file of these names",
    )
    MARKED = "its own, in a folder that its marker names as such", "these names in another folder"
    EMPTY = "nothing", "a folder that holds anything"
    FREE = "nothing: takes the next free name", "nothing"
    KEY = "`[model] file` in it, which `--undo` takes back", "nothing"

    @property
    def replaces(self) -> str:
        """What the command replaces."""
        return self.value[0]

    @property
    def refuses(self) -> str:
        """What the command refuses, exit code 2."""
        return self.value[1]


@dataclass(frozen=True)
class Writes:
    """Declares of an option what the command writes there. names: in a folder, or beside the file (`*`: its name)."""

    what: str
    standing: Standing = Standing.FILE
    names: tuple[str, ...] = ()


RecordingArgument = Annotated[Path, argument(f"Recording ({SIGNALS}) or CAN log ({LOGS}).", "RECORDING")]
RecordingsArgument = Annotated[
    list[Path], argument(f"Recordings ({SIGNALS}) or CAN logs ({LOGS}).", "RECORDING")
]
OptionalRecordingsArgument = Annotated[
    list[Path] | None,
    argument(f"Recordings ({SIGNALS}) or CAN logs ({LOGS}).", "RECORDING"),
]
BenchOption = Annotated[
    Path,
    file_option("--bench", "Bench file (default: the example bench of the package).", show_default=False),
]
FuelTemperatureOption = Annotated[
    float | None,
    option(
        "--fuel-temperature", "Fuel temperature [degC] (default: reference_temperature of the injector file)."
    ),
]
LenientOption = Annotated[
    bool, option("--lenient", "Accept bus databases whose signals overlap or exceed their message.")
]
ModelOption = Annotated[Path | None, file_option("--model", "Injector file, instead of the bench file's.")]
DecoderOption = Annotated[
    Path | None,
    file_option("--bench", "Bench file that says how to read CAN logs and files of your own layout."),
]
StateOption = Annotated[Path | None, file_option("--state", "Learned state to start from.")]
InjectorOption = Annotated[
    str | None, option("--injector", "Name of one injector, where the bench file has several.", "NAME")
]
FromChannelOption = Annotated[
    list[str] | None,
    link_option(
        "--from-channel",
        "Channel with the inputs, where a CAN log has several; LINK=CHANNEL for one bus of [links].",
    ),
]
YesOption = Annotated[
    bool, option("--yes", "Read files of other layouts as it is guessed which column is which.")
]
ForceOption = Annotated[bool, option("--force", "Replace existing files.")]
JsonOption = Annotated[bool, option("--json", "Results as JSON on stdout.")]


def decoder_of(
    bench: Path | None, injector: str | None, lenient: bool, model: Path | None = None
) -> Bench | None:
    """The bench of `--bench`, with the injector of `--injector` only; None without one.

    Raises `UserError` for files that do not fit, and for an injector of no bench file.
    """
    if bench is not None:
        return load_bench(bench, model, lenient, off_bus=True).of(injector)
    if injector is not None:
        raise UserError(f"--injector {injector}", "names one of a bench file", "give that by --bench")
    return None
