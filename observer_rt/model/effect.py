"""What an effect is: a named departure of injector, line or sensors from the nominal model."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from observer_rt.model.effective import EffectiveModel


class Place(StrEnum):
    """Where an effect sits, however the line between the places is modelled."""

    RAIL_INLET = "rail_inlet"
    LINE_FLOW = "line_flow"
    CLOSED_END = "closed_end"
    SEAT = "seat"
    SAC = "sac"
    NOZZLE = "nozzle"
    CHAMBER = "chamber"
    RAIL_SENSOR = "rail_sensor"
    LIFT_SENSOR = "lift_sensor"
    LINE_SENSOR = "line_sensor"


class EffectClass(StrEnum):
    """What kind of change an effect is."""

    DYNAMICS = "dynamics"
    STRUCTURE = "structure"
    INPUT = "input"
    SENSOR = "sensor"


class Equation(StrEnum):
    """The equation that is violated while an effect is missing."""

    LINE_PRESSURE = "line_pressure"  # (20)
    LINE_FLOW = "line_flow"  # (19)
    SAC_PRESSURE = "sac_pressure"  # (22)
    INPUT = "input"
    OUTPUT = "output"


@dataclass(frozen=True)
class EffectParameter:
    """A number of an effect. All fields in SI; `unit` is what it is printed in, SI value = printed value * si.

    off: the value without the effect; lowest, highest: physical bounds; dead_zone: size below which the effect does
    not matter, 0 for a parameter that only shapes it; starts: where a search begins.
    """

    name: str
    unit: str
    si: float
    off: float
    lowest: float
    highest: float
    dead_zone: float
    starts: tuple[float, ...]


@dataclass(frozen=True)
class Effect:
    """An entry of the vocabulary.

    sentence: what it is, for a reader of reports; signature: what it looks like in the signals; indistinguishable:
    ids of effects no measurement of these signals can tell from it; apply: the model with the effect at parameter
    values (SI, in the order of `parameters`), which leaves a model as it is at the `off` values.
    """

    id: str
    effect_class: EffectClass
    place: Place
    equation: Equation
    parameters: tuple[EffectParameter, ...]
    sentence: str
    signature: str
    apply: Callable[[EffectiveModel, Sequence[float]], EffectiveModel]
    indistinguishable: tuple[str, ...] = ()


@dataclass(frozen=True)
class SizedEffect:
    """An effect with the values of its parameters (SI, in the order of `effect.parameters`)."""

    effect: Effect
    values: tuple[float, ...]
