"""Options of commands, said once: the annotated fields of a frozen data class for each command.

A field `save_state` is `--save-state` on the command line; the command is given the whole object.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Annotated


@dataclass(frozen=True)
class Option:
    """Declares a field as an option. metavar: what its value is called, by default after its type.

    A default that `purpose` says in words, as `(default: ...`, is not shown again.
    """

    purpose: str
    metavar: str | None = None
    minimum: float | None = None
    maximum: float | None = None


@dataclass(frozen=True)
class Argument:
    """Declares a field as given without an option."""

    purpose: str
    metavar: str


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


@dataclass(frozen=True)
class Writes:
    """Declares of a field what the command writes there. names: in a folder, or beside the file (`*`: its name)."""

    what: str
    standing: Standing = Standing.FILE
    names: tuple[str, ...] = ()


Injector = Annotated[str | None, Option("Name of one injector, where the bench file has several.", "NAME")]
Lenient = Annotated[bool, Option("Accept bus databases whose signals overlap or exceed their message.")]
