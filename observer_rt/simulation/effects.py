"""Effects of the simulated injector and its sensors, from the command line."""

import math
import re
from collections.abc import Sequence

from observer_rt.config.effects import effect_named, parameter_named, value_in_bounds
from observer_rt.foundation.errors import UserError
from observer_rt.model.effect import EffectParameter, SizedEffect
from observer_rt.model.effects import sized

OPTION = "--effect"


def parse_effects(texts: Sequence[str]) -> tuple[SizedEffect, ...]:
    """Effects from `id[:parameter]=value` in printed units, such as `channel_skew:d=10` or `=10us`; switches are ids.

    An effect with several parameters is given once for each. Raises `UserError` for an unknown id or parameter
    (naming the nearest), another unit, a value that is no number or out of bounds, and a parameter given twice.
    """
    sizes: dict[str, dict[str, float]] = {}
    for text in texts:
        key, separator, printed = text.partition("=")
        name, colon, parameter_name = (part.strip() for part in key.partition(":"))
        effect = effect_named(OPTION, name)
        if not effect.parameters:
            if colon or separator or name in sizes:
                raise UserError(OPTION, f"'{text}' is a switch", f"write it as {name}, once")
            sizes[name] = {}
            continue
        if not separator:
            raise UserError(OPTION, f"'{text}' has no '=value'", "write it as orifice_area:v_H=0.3")
        parameter = parameter_named(OPTION, effect, parameter_name) if colon else effect.parameters[0]
        values = sizes.setdefault(name, {})
        if parameter.name in values:
            raise UserError(OPTION, f"'{name}:{parameter.name}' is given twice", "give each parameter once")
        values[parameter.name] = value_in_bounds(OPTION, effect, parameter, _number(printed, parameter))
    return tuple(sized(name, **values) for name, values in sizes.items())


def sizes_of(one: SizedEffect) -> str:
    """An effect with its sizes and their units, such as `channel_skew d = 10 us`."""
    sizes = [
        f"{p.name} = {value / p.si:g}" + ("" if p.unit == "-" else f" {p.unit}")
        for p, value in zip(one.effect.parameters, one.values, strict=True)
    ]
    return f"{one.effect.id} {', '.join(sizes)}".rstrip()


def _number(text: str, parameter: EffectParameter) -> float:
    """The number, with the parameter's unit or without one; nan for no number."""
    number = re.match(r"[-+]?[\d.]+(?:[eE][-+]?\d+)?", text.strip())
    if number is None:
        return math.nan
    unit = text.strip()[number.end() :].strip()
    if unit not in ("", parameter.unit):
        problem = f"'{text}': the unit of {parameter.name} is not '{unit}'"
        raise UserError(OPTION, problem, f"give the number in {parameter.unit}, or by itself")
    try:
        return float(number[0])
    except ValueError:
        return math.nan
