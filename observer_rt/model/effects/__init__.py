"""The vocabulary of effects: those that the modules of this folder define."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from operator import attrgetter
from pkgutil import iter_modules
from types import MappingProxyType

from observer_rt.model.effect import Component, Effect, SizedEffect
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.parameters import EffectInForce, InjectorParameters

_modules = [import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)]
_effects = [value for module in _modules for value in vars(module).values() if isinstance(value, Effect)]
_in_use = {effect.id: effect for effect in sorted(_effects, key=attrgetter("id"))}
VOCABULARY: Mapping[str, Effect] = MappingProxyType(_in_use)
"""All effects by id."""


def seen_in(has_lift: bool) -> tuple[Effect, ...]:
    """Effects that recordings can show: those of the lift's sensor, or where no lift was recorded of the needle."""
    idle = Component.NEEDLE if has_lift else Component.LIFT_SENSOR
    return tuple(effect for effect in VOCABULARY.values() if effect.component is not idle)


def sized(effect_id: str, **values: float) -> SizedEffect:
    """An effect of the vocabulary with parameter values (SI), the others off. Raises KeyError for unknown ones."""
    effect = VOCABULARY[effect_id]
    unknown = values.keys() - {parameter.name for parameter in effect.parameters}
    if unknown:
        raise KeyError(f"{effect_id} has no parameter {', '.join(sorted(unknown))}")
    return SizedEffect(effect, tuple(values.get(p.name, p.off) for p in effect.parameters))


def sized_in_force(effect: EffectInForce) -> SizedEffect:
    """An effect of the injector file, its values in SI. Raises KeyError for an id that is not in the vocabulary."""
    by_name = {p.name: p for p in VOCABULARY[effect.id].parameters}
    return sized(effect.id, **{name: printed.value * by_name[name].si for name, printed in effect.parameters.items()})


def effective_model(parameters: InjectorParameters, effects: Sequence[SizedEffect] = ()) -> EffectiveModel:
    """The model of an injector with the effects and terms in force in its file, and with `effects` besides.

    An effect that is in both acts twice: additions are relative to the model in force.
    """
    terms = tuple(stated.term for stated in parameters.terms)
    model = EffectiveModel(parameters.model_copy(update={"effects": (), "terms": ()}), terms=terms)
    for item in (*map(sized_in_force, parameters.effects), *effects):
        model = item.effect.apply(model, item.values)
    return model
