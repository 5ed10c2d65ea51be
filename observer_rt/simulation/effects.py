"""Deviations of the simulated injector and its sensors from the nominal model, by their ids."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from observer_rt.errors import UserError
from observer_rt.names import hint
from observer_rt.units import MEGAPASCAL

OPTION = "--effect"


@dataclass(frozen=True)
class PlantEffects:
    """Sizes of the effects in the simulated plant; all 0 is a healthy injector with true sensors."""

    orifice_area: float = 0.0
    """v_H: nozzle flow times 1 + v_H; erosion > 0, coking < 0."""
    seat_area: float = 0.0
    """v_S: seat flow times 1 + v_S."""
    line_pressure_sensor_offset: float = 0.0
    """Measured minus true line pressure [Pa]."""
    rail_pressure_sensor_offset: float = 0.0
    """Measured minus true rail pressure [Pa]."""


class _Definition(NamedTuple):
    parameter: str
    factor: float  # SI value of one unit on the command line
    allowed: Callable[[float], bool]
    range_text: str


def _is_area_change(value: float) -> bool:
    return -1.0 < value <= 5.0


def _is_pressure_offset(value: float) -> bool:
    return abs(value) <= 50.0


_AREA = "above -1 and up to 5"
_OFFSET = "-50 to 50 MPa"
_DEFINITIONS = {
    "orifice_area": _Definition("v_H", 1.0, _is_area_change, _AREA),
    "seat_area": _Definition("v_S", 1.0, _is_area_change, _AREA),
    "line_pressure_sensor_offset": _Definition("o", MEGAPASCAL, _is_pressure_offset, _OFFSET),
    "rail_pressure_sensor_offset": _Definition("o", MEGAPASCAL, _is_pressure_offset, _OFFSET),
}


def parse_effects(texts: Sequence[str]) -> PlantEffects:
    """Effects from `id[:parameter]=value`, such as `orifice_area:v_H=0.3` (offsets in MPa).

    Raises `UserError` for an unknown id or parameter (naming the nearest), a value that is no number or out
    of range, and an effect given twice.
    """
    effects = PlantEffects()
    seen: set[str] = set()
    for text in texts:
        name, value = _parse(text)
        if name in seen:
            raise UserError(OPTION, f"'{name}' is given twice", "give each effect once")
        seen.add(name)
        effects = replace(effects, **{name: value})
    return effects


def _parse(text: str) -> tuple[str, float]:
    key, separator, printed = text.partition("=")
    name, colon, parameter = (part.strip() for part in key.partition(":"))
    if not separator:
        raise UserError(OPTION, f"'{text}' has no '=value'", "write it as orifice_area:v_H=0.3")
    if name not in _DEFINITIONS:
        raise UserError(
            OPTION,
            f"unknown effect '{name}'{hint(name, _DEFINITIONS)}",
            f"known effects: {', '.join(f'{known}:{d.parameter}' for known, d in _DEFINITIONS.items())}",
        )
    definition = _DEFINITIONS[name]
    if colon and parameter != definition.parameter:
        raise UserError(
            OPTION,
            f"'{name}' has no parameter '{parameter}'",
            f"its parameter is {definition.parameter}, which may be left out",
        )
    try:
        value = float(printed)
    except ValueError:
        value = math.nan
    if not definition.allowed(value):
        raise UserError(
            OPTION,
            f"'{printed.strip()}' is no value for {name}:{definition.parameter}",
            f"allowed: {definition.range_text}",
        )
    return name, value * definition.factor
