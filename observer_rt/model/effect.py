"""Effects: named departures of injector, line or sensors from the nominal model, and their bounds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import Self

from observer_rt.model.effective import EffectiveModel

ModelChange = Callable[[EffectiveModel, Sequence[float]], EffectiveModel]
"""The model with an effect at parameter values, in SI and in the order of its parameters."""


class Proof(StrEnum):
    """Measurements that tell effects apart where rail pressure, lift and line pressure do not."""

    BOTH_CHANNELS = (
        "one signal fed to both pressure channels: a skew shifts it, a lag rounds it; or more samples a second"
    )
    FUEL_OR_DRAWING = "a fuel sample (bulk modulus), or the line's volume by drawing: no signal distinguishes them"
    SAMPLE_OR_BALANCE = "the density of a fuel sample, or the injected mass on a balance"
    LIFT_GAUGE = "the lift sensor against a gauge, at the stop and just off the seat"
    LIFT_GAUGE_OR_RATE = f"{LIFT_GAUGE}; or the injection rate measured"
    LIFT_STEP = "the lift channel's answer to a step at its amplifier's input"
    BALLISTIC_RATE = "the injection rate measured, with ballistic injections among them"
    BALLISTIC = "more injections too short for the needle to reach its stop, of several durations"
    LIFT_RECORDED = "the lift of the needle recorded, too, if only on a bench"
    PRESSURE_GAUGE = "standstill at several rail pressures, and both sensors vented (0 MPa) or against a gauge"


WITH_A_MEASURED_RATE: dict[str, str] = {
    Proof.LIFT_GAUGE_OR_RATE: Proof.LIFT_GAUGE,
    Proof.BALLISTIC_RATE: Proof.BALLISTIC,
}
"""Measurements that are left of these where the injection rate was measured."""


class Equation(StrEnum):
    """The equation that is violated while an effect is missing."""

    LINE_PRESSURE = "line_pressure"  # (20)
    LINE_FLOW = "line_flow"  # (19)
    SAC_PRESSURE = "sac_pressure"  # (22)
    INPUT = "input"
    OUTPUT = "output"


class Component(StrEnum):
    """Part of the bench on which an effect acts, and the equation that is violated while the effect is missing."""

    RAIL_INLET = "rail_inlet", Equation.LINE_FLOW
    LINE_FLOW = "line_flow", Equation.LINE_FLOW
    CLOSED_END = "closed_end", Equation.LINE_PRESSURE
    NEEDLE = "needle", Equation.INPUT
    SEAT = "seat", Equation.SAC_PRESSURE
    SAC = "sac", Equation.SAC_PRESSURE
    NOZZLE = "nozzle", Equation.LINE_PRESSURE
    CHAMBER = "chamber", Equation.INPUT
    RAIL_SENSOR = "rail_sensor", Equation.INPUT
    LIFT_SENSOR = "lift_sensor", Equation.INPUT
    LINE_SENSOR = "line_sensor", Equation.OUTPUT

    equation: Equation

    def __new__(cls, name: str, equation: Equation = Equation.INPUT) -> Self:
        """A member that is its name and knows its equation."""
        member = str.__new__(cls, name)
        member._value_, member.equation = name, equation
        return member


class Likeness(StrEnum):
    """How hard two effects are to tell apart by rail pressure, lift and line pressure."""

    SAME = "same"  # nothing in these signals distinguishes them
    ALIKE = "alike"  # the two of them found together are one, indistinguishable
    NEAR = "near"  # good recordings tell them apart


@dataclass(frozen=True)
class Relation:
    """Other effects for which an effect may be taken; of two such effects one states the relation."""

    others: tuple[str, ...]  # ids
    likeness: Likeness
    decided_by: str  # measurement that distinguishes them


@dataclass(frozen=True)
class EffectParameter:
    """A number of an effect. All fields are in SI."""

    name: str
    unit: str  # in which it is printed
    si: float  # SI value over printed value
    off: float  # without the effect
    lowest: float  # physical bounds
    highest: float
    dead_zone: float  # size below which the effect does not matter; 0: the parameter only shapes it
    starts: tuple[float, ...]  # of a search


def parameter(
    name: str,
    lowest: float,
    highest: float,
    dead_zone: float,
    starts: Sequence[float] = (0.0,),
    unit: str = "-",
    si: float = 1.0,
) -> EffectParameter:
    """A parameter that is off at 0, its numbers in the printed unit, `si` the size of that unit in SI."""
    bounds, first = (lowest * si, highest * si), tuple(start * si for start in starts)
    return EffectParameter(name, unit, si, 0.0, *bounds, dead_zone * si, first)


@dataclass(frozen=True)
class Effect:
    """An entry of the vocabulary."""

    id: str  # in lower case, as on the command line
    component: Component
    parameters: tuple[EffectParameter, ...]
    apply: ModelChange  # leaves a model unchanged at the `off` values
    sentence: str  # what happens, for reports
    signature: str  # how that looks in the signals
    relations: tuple[Relation, ...] = ()  # to effects for which it may be taken
    decided_by: str = ""  # measurement that distinguishes it from effects without a relation; empty: there is none
    apparent: bool = False  # whether its apparent size is of interest where it was not found
    remedy: str = ""  # what a user does about an effect of the bench, which no injector file can have in force
    wear: bool = False  # whether injectors get it as they age

    @property
    def equation(self) -> Equation:
        """The equation that is violated while the effect is missing."""
        return self.component.equation

    def relation_to(self, other: "Effect") -> Relation | None:
        """Relation to another effect, whichever of the two states it."""
        stated = [r for r in self.relations if other.id in r.others]
        stated += [r for r in other.relations if self.id in r.others]
        return stated[0] if stated else None

    def is_like(self, other: "Effect", likeness: Likeness) -> bool:
        """Whether it is related to another effect in this way."""
        relation = self.relation_to(other)
        return relation is not None and relation.likeness is likeness


@dataclass(frozen=True)
class SizedEffect:
    """An effect with the values of its parameters (SI, in the order of `effect.parameters`)."""

    effect: Effect
    values: tuple[float, ...]


def scaled(part: str, *names: str) -> ModelChange:
    """Change by a share: the values `names` of a part of the model, as of `added`, times 1 + value [-]."""
    return partial(_scaled, part, names)


def added(part: str, name: str) -> ModelChange:
    """Change by a value [SI], added to `name` of a part of the model, as of `EffectiveModel.part`."""
    return partial(_added, part, name)


# Functions of the module, for closures could not be pickled, nor results which hold effects.
def _scaled(part: str, names: tuple[str, ...], model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    before = model.part(part)
    return model.with_changes(part, **{name: getattr(before, name) * (1.0 + values[0]) for name in names})


def _added(part: str, name: str, model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    return model.with_changes(part, **{name: getattr(model.part(part), name) + values[0]})
