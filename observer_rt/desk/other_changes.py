"""Differences of two injector files besides what the second one adds: corrections that taking it over would undo."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pydantic import BaseModel

from observer_rt.model.parameters import InjectorParameters, UnitName

_OF_A_FINDING = frozenset({"effects", "terms", "remainder"})
_OF_A_FIT = "baseline"


def other_changes(before: InjectorParameters, after: InjectorParameters) -> tuple[str, ...]:
    """Parameters that differ, and effects and terms that are changed or left out."""
    return (*parameter_changes(before, after), *_of_additions(_additions(before), _additions(after)))


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


@dataclass(frozen=True)
class _Addition:
    """An effect or term in force: what tells it from others, its numbers, and all in words."""

    key: object
    numbers: object
    words: str


def _of_additions(before: Sequence[_Addition], after: Sequence[_Addition]) -> Iterator[str]:
    present = {addition.key: addition for addition in after}
    for addition in before:
        if addition.key not in present:
            yield f"{addition.words} is left out"
        elif present[addition.key].numbers != addition.numbers:
            yield f"{addition.words} -> {present[addition.key].words}"


def _additions(injector: InjectorParameters) -> Sequence[_Addition]:
    effects = [
        _Addition(
            effect.id,
            {name: (size.value, size.unit) for name, size in effect.parameters.items()},
            effect.words,
        )
        for effect in injector.effects
    ]
    terms = [
        _Addition(
            (term.equation, term.law),
            term.coefficient and (term.coefficient.value, term.coefficient.unit),
            term.words,
        )
        for term in injector.terms
    ]
    return [*effects, *terms]
