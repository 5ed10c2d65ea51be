"""Notes of a call: what the command line would print besides its result; its warnings become Python's."""

import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from io import StringIO

from rich.console import Console

from observer_rt.foundation.errors import UserError

screen = Console(stderr=True)
"""Shows progress, on a terminal or in a notebook."""
_WARNING = "warning: "
_OPTION = re.compile(r"`[^`]*`|--([a-z][a-z-]*)")
NO_NAMES: Mapping[str, str] = {}
_WIDE = 1 << 16  # no line is broken


class ObserverWarning(UserWarning):
    """A doubt about recordings or models, with its remedy."""


class CallNotes(list[str]):
    """Notes of a call, a line or more each; `console` takes them."""

    def __init__(self) -> None:
        super().__init__()
        self._text = StringIO()
        self.console = Console(file=self._text, width=_WIDE, force_terminal=False)

    def end(self) -> None:
        """Append the lines that were written to the console."""
        for line in self._text.getvalue().splitlines():
            if line.startswith(" ") and self:
                self[-1] += f"\n{line}"
            else:
                self.append(line)


@contextmanager
def naming_parameters(names: Mapping[str, str] = NO_NAMES) -> Iterator[None]:
    """Within the block, errors name parameters of the call instead of options; whole commands in backticks stay.

    names: parameters by options of another name.
    """
    try:
        yield
    except UserError as error:
        parts = names.get(error.location, error.location), error.problem, error.remedy
        named = (_OPTION.sub(lambda o: f"{o[1].replace('-', '_')}=" if o[1] else o[0], part) for part in parts)
        raise UserError(*named) from None


@contextmanager
def noted() -> Iterator[CallNotes]:
    """Collect the notes of the block; at its end, turn those marked as warnings into warnings."""
    notes = CallNotes()
    with naming_parameters():
        yield notes
    notes.end()
    for note in notes:
        if note.startswith(_WARNING):
            warnings.warn(note.removeprefix(_WARNING), ObserverWarning, stacklevel=4)
