"""What a fit may change: the structures of a model it tries, and the parameters it frees in each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.units import CUBIC_MILLIMETRE, MILLIMETRE
from observer_rt.model.parameters import InjectorParameters, LineOutflow


@dataclass(frozen=True)
class FreeParameter:
    """A parameter of the injector file that a fit sizes on a logarithmic scale.

    symbol: as in the equations; section, key: where it stands in the file; unit, si: of printed values; lowest,
    highest: bounds [SI]; start: where the file has none, or 0 [SI].
    """

    symbol: str
    section: str
    key: str
    unit: str
    si: float
    lowest: float
    highest: float
    start: float

    @property
    def name(self) -> str:
        """Such as `line.loss_factor`."""
        return f"{self.section}.{self.key}"

    def of(self, injector: InjectorParameters) -> float:
        """Its value [SI], never 0."""
        value = getattr(getattr(injector, self.section), self.key)
        return float(np.clip(value, self.lowest, self.highest)) if value else self.start


STIFFNESS = FreeParameter("K_L", "fluid", "bulk_modulus_line", "GPa", 1e9, 0.2e9, 8e9, 1.6e9)
LOSS = FreeParameter("xi", "line", "loss_factor", "-", 1.0, 0.01, 500.0, 8.0)
SEAT = FreeParameter("alpha_S", "seat", "flow_coefficient", "-", 1.0, 0.05, 5.0, 0.75)
NOZZLE = FreeParameter("alpha_H", "nozzle", "flow_coefficient", "-", 1.0, 0.05, 5.0, 0.78)
SAC = FreeParameter("V_S", "nozzle", "sac_volume", "mm3", CUBIC_MILLIMETRE, 5e-12, 1e-6, 1e-9)
INERTANCE = FreeParameter("d_L", "line", "diameter", "mm", MILLIMETRE, 0.2e-3, 20e-3, 2.4e-3)
"""Stands for A_L/(rho_L L_L), in which it enters; free only when a measured rate or mass tells the level."""


@dataclass(frozen=True)
class Structure:
    """A form of the model. line: what its [line] says; free: its parameters that a fit sizes."""

    name: str
    outflow: LineOutflow
    line: Mapping[str, str]
    free: tuple[FreeParameter, ...]

    def of(self, injector: InjectorParameters) -> InjectorParameters:
        """An injector in this form, its numbers as they are."""
        return injector.model_copy(
            update={"line_outflow": self.outflow, "line": injector.line.model_copy(update=dict(self.line))}
        )

    def is_of(self, injector: InjectorParameters) -> bool:
        """Whether an injector has this form already."""
        return self.of(injector) == injector


_ORIFICES = (SEAT, NOZZLE, SAC)
_LINES: Mapping[str, tuple[FreeParameter, ...]] = {"lump": (STIFFNESS, LOSS)}
_WORDS = {"lump": "one lump"}
_DRAINED = {LineOutflow.NOZZLE: "drained by the nozzle flow", LineOutflow.SEAT: "drained by the seat flow"}
STRUCTURES: tuple[Structure, ...] = tuple(
    Structure(f"{_WORDS[line]}, {words}", outflow, {"model": line}, (*free, *_ORIFICES))
    for line, free in _LINES.items()
    for outflow, words in _DRAINED.items()
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
