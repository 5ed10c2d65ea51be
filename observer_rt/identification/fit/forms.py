"""Structures of the model that a fit tries, and the parameters of the injector file that it sizes in them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from observer_rt.core.model.model import STEP
from observer_rt.foundation.units import CUBIC_MILLIMETRE, MICROSECOND, MILLIMETRE, MM3_PER_MS, Floats
from observer_rt.identification.likelihood.bounded_fit import NORMAL_975
from observer_rt.model.effect import Effect
from observer_rt.model.effective import coefficients
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.hydraulics import CONTROL_EDGE, CONTROL_END, CONTROL_START
from observer_rt.model.parameters import FEWEST_CELLS, EffectInForce, EffectValue, InjectorParameters, LineOutflow
from observer_rt.model.wave_line import DAMPING, cells_for

CALM_STRAIN = 0.93  # of what a step may be, so that a fit can still move
_DRAINED = {LineOutflow.NOZZLE: "drained by the nozzle flow", LineOutflow.SEAT: "drained by the seat flow"}
LARGEST_SIGMA = 3.0  # of a logarithm, in an interval
_TRIED = "tried"  # origin of an effect that is not the file's


@dataclass(frozen=True)
class FreeParameter:
    """A parameter of the injector file that a fit sizes, on a logarithmic or a linear scale."""

    symbol: str  # as in the equations
    section: str  # of the file
    key: str  # of the file
    unit: str  # of printed values
    si: float  # of the unit
    lowest: float  # SI
    highest: float
    start: float  # SI, if the file has none, or 0 on a logarithmic scale
    spread: float  # standard deviation on the scale before anything was measured, on a linear one about `start`
    linear: float = 0.0  # SI value of 1 on a linear scale; 0: the scale is logarithmic

    @property
    def name(self) -> str:
        """Such as `line.loss_factor`."""
        return f"{self.section}.{self.key}"

    def stated(self, injector: InjectorParameters) -> float | None:
        """Value [SI] in an injector's file, None without one."""
        value: float | None = getattr(getattr(injector, self.section), self.key)
        return value

    def of(self, injector: InjectorParameters) -> float:
        """Value [SI] of an injector, cut at the bounds."""
        stated = self.stated(injector)
        value = self.start if stated is None or not (stated or self.linear) else stated
        return float(np.clip(value, self.lowest, self.highest))

    def theta_of(self, value: float) -> float:
        """A value [SI] on its scale."""
        return value / self.linear if self.linear else math.log(value)

    def value_of(self, theta: float) -> float:
        """Value [SI] of a place on its scale."""
        return theta * self.linear if self.linear else math.exp(theta)

    def interval(self, value: float, sigma: float) -> tuple[float, float]:
        """95 % interval of a value [SI] whose standard deviation on its scale is `sigma`."""
        half = NORMAL_975 * min(sigma, self.spread if self.linear else LARGEST_SIGMA)
        if self.linear:
            return max(value - half * self.linear, self.lowest), min(value + half * self.linear, self.highest)
        return value * math.exp(-half), value * math.exp(half)


@dataclass(frozen=True)
class FittedNumber:
    """A parameter with its 95 % interval, in its printed unit. file: what the file had, None: nothing."""

    symbol: str
    value: float
    ci95: tuple[float, float]
    file: float | None
    unit: str


@dataclass(frozen=True)
class EffectSize(FreeParameter):
    """Size of an effect of the vocabulary beside those in force, on a linear scale of its dead zones."""

    @classmethod
    def of_effect(cls, effect: Effect) -> Self:
        """The size of an effect's first parameter; the others stay where a search begins."""
        first = effect.parameters[0]
        lowest, highest, scale = first.lowest, first.highest, first.dead_zone
        spread = (highest - lowest) / scale
        return cls(first.name, "effects", effect.id, first.unit, first.si, lowest, highest, 0.0, spread, scale)

    def stated(self, injector: InjectorParameters) -> float | None:
        """Value [SI] in force, None if the effect is not."""
        sizes = [each.parameters[self.symbol].value for each in injector.effects if self._is_made(each)]
        return self.si * sizes[0] if sizes else None

    def in_force(self, injector: InjectorParameters, value: float) -> InjectorParameters:
        """An injector with the effect at a value [SI]."""
        parameters = VOCABULARY[self.key].parameters
        sized = zip(parameters, [value, *(one.starts[0] for one in parameters[1:])], strict=True)
        sizes = {one.name: EffectValue(value=size / one.si, unit=one.unit) for one, size in sized}
        others = [each for each in injector.effects if not self._is_made(each)]
        effect = EffectInForce(id=self.key, parameters=sizes, origin=_TRIED)
        return injector.model_copy(update={"effects": (*others, effect)})

    def _is_made(self, effect: EffectInForce) -> bool:
        return (effect.id, effect.origin) == (self.key, _TRIED)


STIFFNESS = FreeParameter("K_L", "fluid", "bulk_modulus_line", "GPa", 1e9, 0.2e9, 8e9, 1.6e9, 0.5)
LOSS = FreeParameter("xi", "line", "loss_factor", "-", 1.0, 0.01, 500.0, 8.0, 1.0)
SEAT = FreeParameter("alpha_S", "seat", "flow_coefficient", "-", 1.0, 0.05, 5.0, 0.75, 0.5)
NOZZLE = FreeParameter("alpha_H", "nozzle", "flow_coefficient", "-", 1.0, 0.05, 5.0, 0.78, 0.5)
SAC = FreeParameter("V_S", "nozzle", "sac_volume", "mm3", CUBIC_MILLIMETRE, 1e-11, 1e-6, 1e-9, 1.0)
WAVE_DAMPING = FreeParameter("nu", "line", "damping", "m2/s", 1.0, 0.01, 20.0, DAMPING, 2.0)
END = FreeParameter("V_E", "line", "end_volume", "mm3", CUBIC_MILLIMETRE, 1e-10, 1e-5, 1e-8, 2.0)
WALL = FreeParameter("nu_w", "line", "wall_viscosity", "mm2/s", 1e-6, 1e-7, 1e-4, 4e-6, 1.0)
INLET = FreeParameter("xi_I", "line", "inlet_loss_factor", "-", 1.0, 0.01, 500.0, 4.0, 1.5)
RATIO = FreeParameter("Z_2/Z_1", "line", "impedance_ratio", "-", 1.0, 0.2, 5.0, 1.0, 0.5)
JOINT = FreeParameter("l_1/L", "line", "impedance_step", "-", 1.0, 0.1, 0.9, 0.5, 0.5)
INERTANCE = FreeParameter("d_L", "line", "diameter", "mm", MILLIMETRE, 0.2e-3, 20e-3, 2.4e-3, 0.3)
"""Stands for A_L/(rho_L L_L), in which it enters."""
STIFFENING = FreeParameter("K_1", "fluid", "bulk_modulus_by_pressure", "-", 1.0, 0.1, 20.0, 10.5, 1.0, 1.0)
"""Free where the fuel stiffens, with K_0 as `STIFFNESS`. Never left to the file: its prior is that of usual fuels."""
NOZZLE_SLOPE = FreeParameter("k_H", "nozzle", "coefficient_by_pressure", "%/100 MPa", 0.01, -0.3, 0.3, 0.0, 2.0, 0.01)
LEVEL = (INERTANCE, NOZZLE_SLOPE)  # free when a measured rate or mass gives it, which may differ by pressure
_TIME = 1e-4  # s
CONTROL = (
    FreeParameter("c", "line", "control_flow", "mm3/ms", MM3_PER_MS, 0.0, 1.5e-4, 0.0, 4.0, MM3_PER_MS),
    FreeParameter("t_on", "line", "control_start", "us", MICROSECOND, -0.2e-3, 0.8e-3, CONTROL_START, 0.8, _TIME),
    FreeParameter("t_off", "line", "control_end", "us", MICROSECOND, -0.4e-3, 0.8e-3, CONTROL_END, 0.8, _TIME),
    FreeParameter("h", "line", "control_hold", "-", 1.0, -1.0, 1.0, 0.0, 0.3, 1.0),
    FreeParameter("n", "line", "control_exponent", "-", 1.0, -2.0, 2.0, 0.0, 0.4, 1.0),
    FreeParameter("w", "line", "control_edge", "us", MICROSECOND, 5e-6, 0.4e-3, CONTROL_EDGE, 1.0),
    FreeParameter("A_c", "line", "control_displacement", "mm2", 1e-6, 0.0, 1e-4, 0.0, 4.0, 1e-6),
)
"""Of the pilot valve of a servo injector."""
DISPLACEMENT = FreeParameter("A_d", "line", "displacement", "mm2", 1e-6, -1e-5, 1e-4, 0.0, 4.0, 1e-6)
NEEDLE = (
    FreeParameter("t_o", "needle", "opening_delay", "us", MICROSECOND, 10e-6, 5e-3, 0.3e-3, 0.3),
    FreeParameter("v_o", "needle", "opening_speed", "m/s", 1.0, 0.05, 10.0, 0.8, 0.2),
    FreeParameter("t_c", "needle", "closing_delay", "us", MICROSECOND, 10e-6, 5e-3, 0.3e-3, 0.4),
    FreeParameter("v_c", "needle", "closing_speed", "m/s", 1.0, 0.05, 10.0, 0.9, 0.2),
)
"""Free where the lift was not measured; delays and speeds at 100 MPa."""
ANY_NEEDLE = tuple(replace(one, spread=0.6) for one in NEEDLE)
"""The same where the file's needle may be another: with a map of masses, or where a fit from it ended badly."""
FLOW_STARTS = (SAC, *ANY_NEEDLE)
"""What a search by commands begins with: a large sac shows a flow late, as a slow needle does."""
USUAL_SEAT = replace(SEAT, spread=0.12, linear=1.0)
"""Beside any needle, with whose speeds it trades: of seats .6 to .95 is usual, of speeds hardly anything."""
DELAY_EXPONENT = FreeParameter("n_o", "needle", "delay_exponent", "-", 1.0, -2.0, 2.0, 0.0, 0.4, 1.0)
"""Free with a map of masses: the opening delays of 32 real injectors' test plans have .05 to .4."""
OPTIONAL_GROUPS = (CONTROL, (DISPLACEMENT,))
"""Parts that an injector has or lacks; the first parameter of a group must be certain."""


@dataclass(frozen=True)
class Structure:
    """A form of the model: what drains the line, which line it is, and the parameters a fit sizes in it."""

    name: str
    outflow: LineOutflow
    line: str
    free: tuple[FreeParameter, ...]

    @property
    def of_any_needle(self) -> Self:
        """This form where the file's needle may be another: with a usual seat."""
        return replace(self, free=tuple(USUAL_SEAT if one is SEAT else one for one in self.free))

    def of(self, injector: InjectorParameters, spare: float = 1.0) -> InjectorParameters:
        """An injector with its own numbers in this form, its line in the cells that serve it best.

        spare: factor by which the stiffness may still grow in these cells; the damping may grow by its fourth power.
        """
        keys: dict[str, object] = {"model": self.line, "cells": None}
        if RATIO not in self.free:
            keys |= {RATIO.key: None, JOINT.key: None}
        keys |= {one.key: None for one in (WALL, INLET) if one not in self.free}
        line = injector.line.model_copy(update=keys)
        formed = injector.model_copy(update={"line_outflow": self.outflow, "line": line})
        if WAVE_DAMPING not in self.free:
            return formed
        return _in_cells(formed, _cells(formed, spare))


def _cells(injector: InjectorParameters, spare: float) -> int:
    free = (STIFFNESS, WAVE_DAMPING)
    grown = with_values(injector, free, values_of(injector, free) * [spare, spare**4])
    best = cells_for(injector, STEP)
    for cells in range(best, FEWEST_CELLS, -1):
        if coefficients(_in_cells(grown, cells)).line.strain(STEP) <= CALM_STRAIN:
            return cells
    return FEWEST_CELLS


def _in_cells(injector: InjectorParameters, cells: int) -> InjectorParameters:
    return injector.model_copy(update={"line": injector.line.model_copy(update={"cells": cells})})


_ORIFICES = (SEAT, NOZZLE, SAC)
_WAVES = (STIFFNESS, LOSS, WAVE_DAMPING, END)
_LINES: Sequence[tuple[str, str, tuple[FreeParameter, ...]]] = (
    ("lump", "one lump", (STIFFNESS, LOSS)),
    ("wave", "waves", _WAVES),
    ("wave", "waves with wall friction", (*_WAVES, WALL)),
    ("wave", "waves behind a throttle", (*_WAVES, INLET)),
    ("wave", "waves with both", (*_WAVES, WALL, INLET)),
    ("wave_two_part", "waves in two parts", (*_WAVES, RATIO, JOINT)),
)
STRUCTURES: tuple[Structure, ...] = tuple(
    Structure(f"{words}, {drained}", outflow, line, (*free, *_ORIFICES))
    for line, words, free in _LINES
    for outflow, drained in _DRAINED.items()
)
"""All that are tried, the simplest first."""
PLAIN = STRUCTURES[:4]  # one lump, and waves without losses of their own


def with_values(injector: InjectorParameters, free: Sequence[FreeParameter], values: Floats) -> InjectorParameters:
    """An injector with other values (p,) [SI] of its free parameters."""
    sections: dict[str, dict[str, float]] = {}
    for parameter, value in zip(free, values, strict=True):
        if isinstance(parameter, EffectSize):
            injector = parameter.in_force(injector, float(value))
            continue
        sections.setdefault(parameter.section, {})[parameter.key] = float(value)
    changed = {name: getattr(injector, name).model_copy(update=keys) for name, keys in sections.items()}
    return injector.model_copy(update=changed)


def values_of(injector: InjectorParameters, free: Sequence[FreeParameter]) -> Floats:
    """Values (p,) [SI] of the free parameters of an injector."""
    return np.array([parameter.of(injector) for parameter in free])


def sizes_of(
    free: Sequence[FreeParameter], sigmas: Floats, before: InjectorParameters, after: InjectorParameters
) -> dict[str, FittedNumber]:
    """Fitted numbers of free parameters by name; sigmas (p,) on the parameters' scales."""
    sizes = {}
    for parameter, sigma in zip(free, sigmas.tolist(), strict=True):
        value, stated, si = parameter.of(after), parameter.stated(before), parameter.si
        low, high = parameter.interval(value, sigma)
        file = None if stated is None else stated / si
        sizes[parameter.name] = FittedNumber(
            parameter.symbol, value / si, (low / si, high / si), file, parameter.unit
        )
    return sizes
