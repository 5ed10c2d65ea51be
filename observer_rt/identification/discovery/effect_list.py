"""The effects of the vocabulary for people and programs: what each is, in which units, and what it is taken for."""

from collections.abc import Iterable, Sequence
from typing import Any

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from observer_rt.model.effect import Effect, EffectParameter, Likeness
from observer_rt.model.effects import VOCABULARY

SCHEMA = 1
_TAKEN_FOR = {
    Likeness.SAME: "the same in every signal as",
    Likeness.ALIKE: "hard to tell from",
    Likeness.NEAR: "may be taken for",
}


def as_table(effects: Sequence[Effect], in_detail: bool) -> RenderableType:
    """Two columns: id with ranges of parameters; what it is and is taken for, in detail how it shows, too."""
    table = Table(box=None, padding=(0, 2, 1, 0), pad_edge=False)
    table.add_column(Text("effect:parameter, bounds [unit]"), no_wrap=True)
    table.add_column(Text("what it is"))
    for effect in effects:
        name = Text(effect.id, style="bold")
        for parameter in effect.parameters:
            low, high = parameter.lowest / parameter.si, parameter.highest / parameter.si
            name.append(f"\n  :{parameter.name} = {low:g} to {high:g} {_unit(parameter)}", style="not bold")
        if not effect.parameters:
            name.append("\n  a switch: no value", style="not bold")
        table.add_row(name, Text("\n".join([effect.sentence, *_more(effect, in_detail)])))
    return table


def as_json(effects: Iterable[Effect]) -> dict[str, Any]:
    """The effects as a document; numbers in the unit stated beside them."""
    return {"schema": SCHEMA, "effects": [_document(effect) for effect in effects]}


def _more(effect: Effect, in_detail: bool) -> list[str]:
    lines = [f"shows as: {effect.signature}"] if in_detail else []
    sizes = [p for p in effect.parameters if p.dead_zone > 0.0]
    if in_detail and sizes:
        matters = ", ".join(f"{p.name} = {p.dead_zone / p.si:g} {_unit(p)}" for p in sizes)
        lines.append(f"matters from {matters} on")
    for likeness, words in _TAKEN_FOR.items():
        others = [other for other in VOCABULARY.values() if effect.is_like(other, likeness)]
        if in_detail:
            for other in others:
                relation = effect.relation_to(other)
                lines.append(f"{words} {other.id}; decided by {relation.decided_by if relation else ''}")
        elif others:
            lines.append(f"{words} {', '.join(other.id for other in others)}")
    if in_detail and effect.decided_by:
        lines.append(f"told from all others by {effect.decided_by}")
    return lines


def _unit(parameter: EffectParameter) -> str:
    return "(no unit)" if parameter.unit == "-" else parameter.unit


def _document(effect: Effect) -> dict[str, Any]:
    return {
        "id": effect.id,
        "place": effect.component.value,
        "equation": effect.equation.value,
        "sentence": effect.sentence,
        "signature": effect.signature,
        "decided_by": effect.decided_by,
        "parameters": [
            {
                "name": p.name,
                "unit": p.unit,
                "lowest": p.lowest / p.si,
                "highest": p.highest / p.si,
                "matters_from": p.dead_zone / p.si,
                "si": p.si,
            }
            for p in effect.parameters
        ],
        "taken_for": [
            {"id": other.id, "likeness": relation.likeness.value, "decided_by": relation.decided_by}
            for other in VOCABULARY.values()
            if (relation := effect.relation_to(other)) is not None
        ],
    }
