"""What the commands of `tools/bench` share: the program they belong to, options, names that are chosen."""

import os
from collections.abc import Collection
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from observer_rt.foundation.errors import UserError

JOBS = os.cpu_count() or 1
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
Tier = StrEnum("Tier", {"A": "A", "B": "B"})
"""Which plant is measured. A: of the nominal structure; B: richer, with travelling waves."""
AnyTier = StrEnum("AnyTier", {"A": "A", "B": "B", "C": "C"})
"""C: realistic injectors."""

CasesOption = Annotated[int, typer.Option(min=0, help="How many.")]
SeedOption = Annotated[int, typer.Option(help="Master seed.")]
JobsOption = Annotated[int, typer.Option(min=1, help="Processes.")]
OutOption = Annotated[Path | None, typer.Option(help="Folder (default: in build/); a run interrupted goes on.")]
TierOption = Annotated[Tier, typer.Option(help="A: a plant of the nominal structure. B: richer; `fit` fits to it.")]
AnyTierOption = Annotated[
    AnyTier, typer.Option(help="A: a plant of the nominal structure. B: richer, C: realistic; `fit` fits to it.")
]
NoLiftOption = Annotated[bool, typer.Option("--no-lift", help="Without a lift: the needle by its commands alone.")]


def chosen_names(text: str, option: str, names: Collection[str], default: Collection[str]) -> tuple[str, ...]:
    """Those of the names that a text has, by commas, else the default. Raises `UserError` for an unknown one."""
    chosen = tuple(name.strip() for name in text.split(",") if name.strip()) or tuple(default)
    for name in chosen:
        if name not in names:
            raise UserError(option, f"unknown name '{name}'", f"known: {', '.join(names)}")
    return chosen
