"""What a fit may change: the structures of a model it tries, and the parameters it frees in each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.units import CUBIC_MILLIMETRE, MILLIMETRE
from observer_rt.model.effective import coefficients
from observer_rt.model.line.wave import DAMPING, FEWEST_CELLS, STEP, cells_for
from observer_rt.model.parameters import InjectorParameters, LineOutflow

CALM = 0.93  # of what a step may be, so that a fit can still move


@dataclass(frozen=True)
class FreeParameter:
    """A parameter of the injector file that a fit sizes on a logarithmic scale.

    symbol: as in the equations; section, key: where it stands in the file; unit, si: of printed values; lowest,
    highest: bounds [SI]; start: where the file has none, or 0 [SI]; spread: standard deviation of its logarithm
    before anything was measured.
    """

    symbol: str
    section: str
    key: str
    unit: str
    si: float
    lowest: float
    highest: float
    start: float
    spread: float

    @property
    def name(self) -> str:
        """Such as `line.loss_factor`."""
        return f"{self.section}.{self.key}"

    def stated(self, injector: InjectorParameters) -> float | None:
        """What an injector's file says [SI]; None where it says nothing."""
        value: float | None = getattr(getattr(injector, self.section), self.key)
        return value

    def of(self, injector: InjectorParameters) -> float:
        """Its value [SI], within the bounds."""
        return float(np.clip(self.stated(injector) or self.start, self.lowest, self.highest))


STIFFNESS = FreeParameter("K_L", "fluid", "bulk_modulus_line", "GPa", 1e9, 0.2e9, 8e9, 1.6e9, 0.5)
LOSS = FreeParameter("xi", "line", "loss_factor", "-", 1.0, 0.01, 500.0, 8.0, 1.0)
SEAT = FreeParameter("alpha_S", "seat", "flow_coefficient", "-", 1.0, 0.05, 5.0, 0.75, 0.5)
NOZZLE = FreeParameter("alpha_H", "nozzle", "flow_coefficient", "-", 1.0, 0.05, 5.0, 0.78, 0.5)
SAC = FreeParameter("V_S", "nozzle", "sac_volume", "mm3", CUBIC_MILLIMETRE, 1e-11, 1e-6, 1e-9, 1.0)
WAVE_DAMPING = FreeParameter("nu", "line", "damping", "m2/s", 1.0, 0.01, 20.0, DAMPING, 2.0)
END = FreeParameter("V_E", "line", "end_volume", "mm3", CUBIC_MILLIMETRE, 1e-10, 1e-6, 1e-8, 2.0)
WALL = FreeParameter("nu_w", "line", "wall_viscosity", "mm2/s", 1e-6, 1e-7, 1e-4, 4e-6, 1.0)
INLET = FreeParameter("xi_I", "line", "inlet_loss_factor", "-", 1.0, 0.01, 500.0, 4.0, 1.5)
RATIO = FreeParameter("Z_2/Z_1", "line", "impedance_ratio", "-", 1.0, 0.2, 5.0, 1.0, 0.5)
JOINT = FreeParameter("l_1/L", "line", "impedance_step", "-", 1.0, 0.1, 0.9, 0.5, 0.5)
INERTANCE = FreeParameter("d_L", "line", "diameter", "mm", MILLIMETRE, 0.2e-3, 20e-3, 2.4e-3, 0.3)
"""Stands for A_L/(rho_L L_L), in which it enters; free only when a measured rate or mass tells the level."""


@dataclass(frozen=True)
class Structure:
    """A form of the model: what drains the line, which line it is, and the parameters a fit sizes in it."""

    name: str
    outflow: LineOutflow
    line: str
    free: tuple[FreeParameter, ...]

    def of(self, injector: InjectorParameters, spare: float = 1.0) -> InjectorParameters:
        """An injector in this form, its numbers as they are, its line in the cells that serve it best.

        spare: by what factor the stiffness, and more than that the damping, may still grow in these cells.
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

    def refines(self, other: "Structure") -> bool:
        """Whether it is another with more parameters: pressure travels in both, and the same flow drains them."""
        travels = WAVE_DAMPING in other.free and set(other.free) < set(self.free)
        return travels and self.outflow is other.outflow


def _cells(injector: InjectorParameters, spare: float) -> int:
    """The cells that serve it best, or as many as are stable with what may still grow."""
    free = (STIFFNESS, WAVE_DAMPING)
    grown = with_values(injector, free, values_of(injector, free) * [spare, spare**4])
    best = cells_for(injector, STEP)
    for cells in range(best, FEWEST_CELLS, -1):
        if coefficients(_in_cells(grown, cells)).line.strain(STEP) <= CALM:
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
_DRAINED = {LineOutflow.NOZZLE: "drained by the nozzle flow", LineOutflow.SEAT: "drained by the seat flow"}
STRUCTURES: tuple[Structure, ...] = tuple(
    Structure(f"{words}, {drained}", outflow, line, (*free, *_ORIFICES))
    for line, words, free in _LINES
    for outflow, drained in _DRAINED.items()
)
"""All that are tried, the simplest first."""


def with_values(
    injector: InjectorParameters, free: Sequence[FreeParameter], values: NDArray[np.float64]
) -> InjectorParameters:
    """An injector with other values (p,) [SI] of its free parameters."""
    sections: dict[str, dict[str, float]] = {}
    for parameter, value in zip(free, values, strict=True):
        sections.setdefault(parameter.section, {})[parameter.key] = float(value)
    return injector.model_copy(
        update={name: getattr(injector, name).model_copy(update=keys) for name, keys in sections.items()}
    )


def values_of(injector: InjectorParameters, free: Sequence[FreeParameter]) -> NDArray[np.float64]:
    """Values (p,) [SI] of the free parameters of an injector."""
    return np.array([parameter.of(injector) for parameter in free])
