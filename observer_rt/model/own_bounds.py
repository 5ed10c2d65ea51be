"""Effects of the vocabulary within other bounds."""

from dataclasses import replace

from observer_rt.model.effect import Effect, EffectParameter


def bounded(effect: Effect, **bounds: tuple[float, float]) -> Effect:
    """The effect with other bounds, lowest and highest of parameters by name, in printed units.

    A search begins within them. Raises KeyError for a parameter the effect does not have.
    """
    unknown = bounds.keys() - {parameter.name for parameter in effect.parameters}
    if unknown:
        raise KeyError(f"{effect.id} has no parameter {', '.join(sorted(unknown))}")
    return replace(
        effect,
        parameters=tuple(_within(p, *bounds[p.name]) if p.name in bounds else p for p in effect.parameters),
    )


def differs_in_bounds_only(effect: Effect, other: Effect) -> bool:
    """Whether it is the other within bounds of its own."""
    if len(effect.parameters) != len(other.parameters) or effect == other:
        return False
    pairs = zip(effect.parameters, other.parameters, strict=True)
    same = tuple(replace(p, lowest=q.lowest, highest=q.highest, starts=q.starts) for p, q in pairs)
    return replace(effect, parameters=same) == other


def _within(parameter: EffectParameter, lowest: float, highest: float) -> EffectParameter:
    low, high = lowest * parameter.si, highest * parameter.si
    inside = dict.fromkeys(min(max(start, low), high) for start in parameter.starts)
    return replace(parameter, lowest=low, highest=high, starts=tuple(inside))
