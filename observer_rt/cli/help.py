"""Help texts in words: what a value is, instead of the type it has in Python."""

import inspect
from collections.abc import Callable
from typing import Any

from typer.core import TyperArgument, TyperCommand, TyperGroup

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
    parameter.display_type = lambda context: (
        "" if is_argument else NAMES.get(of_type(context), of_type(context))
    )


def first_sentence(command: Callable[..., object]) -> str:
    """Of a command's docstring, whole: for the list of commands."""
    return inspect.cleandoc(command.__doc__ or "").split("\n\n")[0].replace("\n", " ")
