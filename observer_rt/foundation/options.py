"""Options of commands, said once: the annotated fields of a frozen data class for each command.

A field `save_state` is `--save-state` on the command line; the command is given the whole object.
"""

from dataclasses import dataclass
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


Injector = Annotated[str | None, Option("Name of one injector, where the bench file has several.", "NAME")]
