"""Effects and terms as users name them, in files and on the command line: looked up, checked, refused by name."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from observer_rt.foundation.errors import UserError, hint
from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE, MM3_PER_MS
from observer_rt.model.effect import Effect, EffectParameter
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.parameters import EffectInForce, InjectorParameters

if TYPE_CHECKING:
    from observer_rt.model.terms.bounds import TermDomain


def effect_named(location: str, name: str) -> Effect:
    """The effect of this id. Raises `UserError` at `location`, naming the nearest."""
    if name not in VOCABULARY:
        raise UserError(
            location,
            f"unknown effect '{name}'{hint(name, VOCABULARY)}",
            f"known effects: {', '.join(_described(effect) for effect in VOCABULARY.values())}; "
            "no file of Python is read for others: state a law of your own in [[terms]] of the injector file "
            "(docs/terms.md)",
        )
    return VOCABULARY[name]


def effects_named(location: str, names: str) -> tuple[str, ...]:
    """Ids of effects, given as `ID` or `ID+ID`; none of an empty text. Raises `UserError` as `effect_named`."""
    return tuple(effect_named(location, name.strip()).id for name in names.split("+")) if names else ()


def parameter_named(location: str, effect: Effect, name: str) -> EffectParameter:
    """The effect's parameter of this name. Raises `UserError` at `location`."""
    for parameter in effect.parameters:
        if parameter.name == name:
            return parameter
    names = ", ".join(parameter.name for parameter in effect.parameters)
    problem = f"'{effect.id}' has no parameter '{name}'"
    raise UserError(location, problem, f"its parameters: {names}" if names else "it has none: leave it out")


def value_in_bounds(location: str, effect: Effect, parameter: EffectParameter, printed: float) -> float:
    """A value in SI. Raises `UserError` at `location` when it is no number or beyond the bounds of physics."""
    value = printed * parameter.si
    if not parameter.lowest <= value <= parameter.highest:
        raise UserError(
            location,
            f"{printed:g} is no value for {effect.id}:{parameter.name}",
            f"allowed: {parameter.lowest / parameter.si:g} to {parameter.highest / parameter.si:g} {parameter.unit}",
        )
    return value


def check_effects(location: str, effects: Sequence[EffectInForce]) -> None:
    """Refuse effects that do not exist, exceed their bounds or repeat, by `UserError` at a key below `location`."""
    seen: set[str] = set()
    for number, entry in enumerate(effects):
        here = f"{location}effects.{number}"
        effect = effect_named(f"{here}.id", entry.id)
        if entry.id in seen:
            raise UserError(f"{here}.id", f"'{entry.id}' is given twice", "give each effect once")
        seen.add(entry.id)
        if effect.remedy:
            raise UserError(f"{here}.id", f"'{entry.id}' is of the bench, not of the injector", effect.remedy)
        if effect.parameters and not entry.parameters:
            first = effect.parameters[0]
            example = f'{{ {first.name} = {{ value = 0.0, unit = "{first.unit}" }} }}'
            raise UserError(here, f"'{entry.id}' has no size", f"add parameters = {example}")
        for name, printed in entry.parameters.items():
            key = f"{here}.parameters.{name}"
            parameter = parameter_named(key, effect, name)
            if printed.unit != parameter.unit:
                raise UserError(f"{key}.unit", f"is '{printed.unit}'", f"give it in '{parameter.unit}'")
            value_in_bounds(f"{key}.value", effect, parameter, printed.value)


def _described(effect: Effect) -> str:
    return ":".join([effect.id, *(p.name if p.unit == "-" else f"{p.name} [{p.unit}]" for p in effect.parameters)])


def term_domain(parameters: InjectorParameters) -> "TermDomain":
    """Domain in which terms of an injector must be sound."""
    from observer_rt.model.terms.bounds import TermDomain  # optional: [[terms]]

    line = parameters.line
    friction = line.loss_factor * parameters.fluid.density_line / line.area**2  # Pa/(m3/s)^2
    friction *= MM3_PER_MS**2 / MEGAPASCAL
    return TermDomain(parameters.seat.max_lift / MILLIMETRE, friction, line.model != "lump")


def check_terms(location: str, parameters: InjectorParameters) -> None:
    """Refuse terms that cannot be read, do not fit or make no sound model, by `UserError` below `location`."""
    from observer_rt.model.terms.bounds import refuse_unbounded

    domain = term_domain(parameters)
    for number, stated in enumerate(parameters.terms):
        here = f"{location}terms.{number}"
        try:
            term = stated.term
        except UserError as error:
            raise UserError(f"{here}.{error.location}", error.problem, error.remedy) from None
        try:
            refuse_unbounded(term, domain)
        except UserError as error:
            raise UserError(f"{here}.law", f"'{error.location}' {error.problem}", error.remedy) from None
