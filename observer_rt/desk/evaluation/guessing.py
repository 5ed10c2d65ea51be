"""Files that no bench file describes: what is guessed is shown, confirmed, and printed as a section to keep."""

import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.prompt import Confirm
from rich.table import Table

from observer_rt.config.bench import Bench, load_bench
from observer_rt.files.formats import guessed, is_log
from observer_rt.files.guess.guess import Guess
from observer_rt.foundation.console import plain_table, say
from observer_rt.foundation.errors import UserError


def as_confirmed(bench: Bench | None, paths: Sequence[Path], yes: bool, console: Console) -> Bench | None:
    """The bench, None: the example, with the layout of the first file that nothing describes, where the user agrees.

    yes: the user does. Where nobody can be asked, a guess without doubts is left to who reads the file. Raises
    `UserError` for a guess that is not agreed to, or lacks a signal.
    """
    can_ask = console.is_terminal and sys.stdin.isatty()
    is_described = bench is not None and (
        len(bench.injectors) > 1 or bench.injector.config.recording is not None
    )
    if is_described or not (yes or can_ask):
        return bench
    for path in paths:
        guess = None if is_log(path) else guessed(path)
        if guess is not None:
            layout = guess.layout
            console.print(as_table(guess))
            if not yes and not Confirm.ask(f"{path}: read it so?", console=console):
                raise UserError(
                    str(path),
                    "is not read as guessed",
                    f"correct the section, in a bench file:\n\n{guess.section()}\n",
                )
            say(console, f"to keep, in a bench file:\n\n{guess.section()}\n")
            return (bench or load_bench()).with_sections(recording=layout)
    return bench


def as_table(guess: Guess) -> Table:
    """The columns guessed, why, and what is doubtful."""
    rows = [
        (each.signal, str(each.column), each.unit, f"{each.factor:g}", each.why, each.doubt)
        for each in guess.columns
    ]
    rate = ("rate", "", "Hz", f"{guess.rate:.10g}", "", guess.rate_doubt)
    return plain_table(("signal", "column", "unit", "factor", "by", "doubt"), [*rows, rate], folds=(5,))
