"""The command `effects`."""

import json
from typing import Annotated

import typer

from observer_rt.cli.options import EffectsOption, JsonOption


def effects(
    ids: Annotated[
        list[str] | None,
        typer.Argument(help="Effects to be told in detail (default: all).", metavar="ID", show_default=False),
    ] = None,
    as_json: JsonOption = False,
    effects: EffectsOption = None,
) -> None:
    """List the effects a model can have: units, bounds, meaning, what each is taken for; check those of your own."""
    from observer_rt.config.effects import effect_named
    from observer_rt.discovery import vocabulary
    from observer_rt.model.effects import VOCABULARY
    from observer_rt.terminal.console import results

    chosen = [effect_named("ID", name) for name in ids or VOCABULARY]
    if as_json:
        print(json.dumps(vocabulary.as_json(chosen), indent=2))
    else:
        results().print(vocabulary.as_table(chosen, in_detail=bool(ids)), highlight=False)
