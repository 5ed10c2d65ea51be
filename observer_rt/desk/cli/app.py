"""The command line: which commands there are, help in words, errors as messages and exit codes."""

import inspect
import os
import sys
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from typing import Annotated, Any, NoReturn, TextIO

import typer
from rich.text import Text
from typer.core import TyperArgument, TyperCommand, TyperGroup

from observer_rt.desk.cli.command import messages, with_options
from observer_rt.foundation.console import visible
from observer_rt.foundation.errors import ObserverError, UserError, missing_library
from observer_rt.foundation.version import __version__

EXIT_CODES = (
    "Exit code: 0 there is a result; 1 it failed at run time, or `check` found an error; "
    "2 the command line or a file of yours must change; 130 it was interrupted."
)
_UsageError: Any = typer.BadParameter.__base__  # of all mistakes in a command line; typer has no name for it
NAMES = {"<int>": "N", "<int range>": "N", "<float>": "NUMBER", "<float range>": "NUMBER", "<str>": "TEXT"}


class GroupedCommands(TyperGroup):
    """Commands listed under the headings they were registered with."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a section for each heading, the commands in it in their order."""
        sections: dict[str, list[tuple[str, str]]] = {}
        for name in self.list_commands(ctx):
            command: Any = self.get_command(ctx, name)
            sections.setdefault(command.rich_help_panel, []).append((name, command.short_help))
        for heading, rows in sections.items():
            with formatter.section(heading):
                formatter.write_dl(rows)


class WordedCommand(TyperCommand):
    """A command whose help names no types of Python."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        for parameter in self.params:
            _reword(parameter)


def _reword(parameter: Any) -> None:
    """Replace what typer says of the type of an option, or of an argument, whose name says enough."""
    of_type, is_argument = parameter.display_type, isinstance(parameter, TyperArgument)
    parameter.display_type = lambda context: "" if is_argument else NAMES.get(of_type(context), of_type(context))


def main() -> None:
    """Entry point of `observer-rt`."""
    try:
        try:
            asked = next((word for word in sys.argv[1:2] if any(word in names for names in COMMANDS.values())), "")
            exit_code = app_of(asked)(standalone_mode=False)
        finally:
            _flush_messages()
            sys.stdout.flush()  # so that what cannot be written shows here
        sys.exit(exit_code)
    except _UsageError as error:
        if not sys.argv[1:]:  # which is answered by the help
            error.show()
            sys.exit(error.exit_code)
        _fail(str(_worded(error)), error.exit_code)
    except ObserverError as error:
        _fail(str(error), error.exit_code)
    except ModuleNotFoundError as error:
        if (missing := missing_library(error.name or "")) is None:
            raise
        _fail(str(missing), missing.exit_code)
    except BrokenPipeError:
        _abandon(sys.stdout)
        sys.exit(1)
    except MemoryError:
        _fail("not enough memory\n  remedy: cut the recording, or sample it slower", 1)
    except RuntimeError as error:
        if "start new thread" not in str(error):  # as Python says it
            raise
        _fail("this process may start no more threads\n  remedy: raise its limits, `ulimit -v` and `ulimit -u`", 1)
    except OSError as error:
        _abandon(sys.stdout)
        _fail(f"{error.filename or 'output'}: {error.strerror or error}", 1)


def _worded(error: Any) -> UserError:
    """The fault of a command line, worded as all other errors."""
    called = error.ctx.info_name if error.ctx is not None and error.ctx.parent is not None else ""
    command = f"observer-rt {called}".strip()
    message = error.format_message().rstrip(".")
    return UserError(called or "command line", message[:1].lower() + message[1:], f"`{command} -h` explains it")


def _flush_messages() -> None:
    """Write the messages that still wait, unless the terminal has hung up."""
    try:
        sys.stderr.flush()
    except OSError:
        _abandon(sys.stderr)


def _abandon(stream: TextIO) -> None:
    """Let the interpreter's own last flush succeed: what cannot be written has been reported, or has no reader."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _fail(message: str, exit_code: int) -> NoReturn:
    # at once: a signal may end the process between two
    messages.print(Text.assemble(("error:", "red"), f" {visible(message)}"), soft_wrap=not messages.is_terminal)
    sys.exit(exit_code)


def _version(show: bool) -> None:
    if show:
        print(f"observer-rt {__version__}")
        raise typer.Exit


def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """`observer-rt` without a command."""


# heading, and of each command its module and an example
COMMANDS: Mapping[str, Mapping[str, tuple[str, str]]] = {
    "Live": {
        "demo": ("live", "--wear 0.3 --figure demo.png"),
        "run": ("live", "--bench bench.toml --state learned.json --journal injections.sqlite --view"),
        "check": ("live", "--bench bench.toml --recording mine.csv"),
        "monitor": ("live", "--bench bench.toml"),
        "take-over": ("models", "missing/amended.toml --bench bench.toml"),
        "record": ("logs", "--bench bench.toml --out bus.blf --duration 3600"),
        "replay": ("logs", "recording.csv --bench bench.toml --speed 0.1"),
    },
    "Offline": {
        "simulate": (
            "offline",
            "--rail-pressure 60,100,140 --energizing-time 0.6,1.9 --injections 12 "
            "--effect orifice_area:v_H=0.3 --output worn.csv",
        ),
        "evaluate": ("offline", "worn.csv --output trace.csv --plot worn.png"),
        "convert": ("logs", "bus.blf recording.csv --bench bench.toml"),
        "fit": ("models", "healthy_*.csv --model injector.toml --output fitted.toml --plot fit.png"),
        "reproduce": ("offline", "--out reproduced"),
    },
    "Discovery": {
        "discover": ("models", "--model injector.toml --out found worn_1.csv worn_2.csv"),
        "effects": ("models", "channel_skew seat_area"),
    },
    "Many recordings": {
        "batch": ("offline", r"measured/ --out results --bench bench.toml --injector-from 'injector_(\w+)'"),
        "trend": ("offline", "results --limit nozzle=30%"),
    },
}


@cache
def app_of(only: str = "") -> typer.Typer:
    """The command line; only: the single command to load, which makes the start faster."""
    app = typer.Typer(
        cls=GroupedCommands,
        no_args_is_help=True,
        context_settings={"help_option_names": ["-h", "--help"]},
        pretty_exceptions_enable=False,
        rich_markup_mode=None,  # units in brackets are not markup
        help="Estimates the injection rate of a common-rail injector in real time, from CAN back onto CAN.",
        epilog="Every command has help: -h. Results go to stdout, progress and errors to stderr.\n\n" + EXIT_CODES,
    )
    app.callback()(_root)
    for heading, commands in COMMANDS.items():
        for name, (module, example) in commands.items():
            if only in ("", name):
                work = getattr(import_module(f"observer_rt.desk.cli.{module}"), name.replace("-", "_"))
                app.command(
                    name,
                    cls=WordedCommand,
                    short_help=inspect.cleandoc(work.__doc__ or "").split("\n\n")[0].replace("\n", " "),
                    epilog=f"Example: observer-rt {name} {example}\n\n{EXIT_CODES}",
                    rich_help_panel=heading,
                )(with_options(work))
    return app
