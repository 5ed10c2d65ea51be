"""Differences of two injector files besides what the second one adds: corrections that taking it over would undo."""

from collections.abc import Iterator
from typing import TypeAlias

from pydantic import BaseModel

from observer_rt.model.parameters import EffectInForce, InjectorParameters, UnitName
from observer_rt.model.terms.in_force import TermInForce

_OF_A_FINDING = frozenset({"effects", "terms", "remainder"})
_OF_A_FIT = "baseline"
_Addition: TypeAlias = EffectInForce | TermInForce


def other_changes(before: InjectorParameters, after: InjectorParameters) -> tuple[str, ...]:
    """Parameters that differ, and effects and terms that are changed or left out."""
    return (*parameter_changes(before, after), *_lost(before, after))


def parameter_changes(before: InjectorParameters, after: InjectorParameters) -> tuple[str, ...]:
    """Parameters that differ, such as `line.length 0.16 m -> 0.15 m`."""
    return tuple(_in_section("", before, after))


def _in_section(prefix: str, before: BaseModel, after: BaseModel) -> Iterator[str]:
    for key, field in type(before).model_fields.items():
        old, new = getattr(before, key), getattr(after, key)
        if old == new or key in _OF_A_FINDING:
            continue
        if key == _OF_A_FIT:
            yield f"{key}: that of another fit"
        elif isinstance(old, BaseModel):
            yield from _in_section(f"{prefix}{key}.", old, new)
        else:
            unit = next((each for each in field.metadata if isinstance(each, UnitName)), "")
            yield f"{prefix}{key} {_shown(old, unit)} -> {_shown(new, unit)}"


def _shown(value: object, unit: str) -> str:
    if value is None:
        return "(left out)"
    if not isinstance(value, float):
        return str(value)
    return f"{value:.12g} {unit}".rstrip()


def _lost(before: InjectorParameters, after: InjectorParameters) -> Iterator[str]:
    """Effects and terms in force that the other file leaves out or states otherwise."""
    stated: list[_Addition] = [*before.effects, *before.terms]
    kept: list[_Addition] = [*after.effects, *after.terms]
    for entry in stated:
        if _stated(entry) not in map(_stated, kept):
            yield f"{entry.words} is left out, or stated otherwise"


def _stated(entry: _Addition) -> tuple[object, ...]:
    """What an effect or term does."""
    if isinstance(entry, TermInForce):
        size = entry.coefficient
        return entry.equation, entry.law, size and (size.value, size.unit)
    return entry.id, {name: (size.value, size.unit) for name, size in entry.parameters.items()}
