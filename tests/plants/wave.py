"""Injectors of the richer plant, with lines unknown to a fit's structures. Imports nothing of `observer_rt`."""

import math
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from tests.plants.arrays import Array
from tests.plants.equations import STIFFNESS_PRESSURE, Rail, density_share
from tests.plants.laws import NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector, with_faults
from tests.plants.wave_equations import STEPS, run_wave
from tests.plants.wave_line_equations import EVEN, MEGAPASCAL, NODES, Lattice, WaveState

SAC_VOLUME = 3e-9  # m3, of the new part
HIDDEN_SHARE = 0.1  # by which the real part differs from its data sheet, at most
KAGAWA_RATES = np.array(
    [26.3744, 72.8033, 187.424, 536.626, 1570.60, 4618.13, 13601.1, 40082.5, 118153.0, 348316.0]
)  # n of the weighting function sum m exp(-n t), in units of viscosity / radius^2
KAGAWA_SHARES = np.array([1.0, 1.16725, 2.20064, 3.92861, 6.78788, 11.6761, 20.0612, 34.4541, 59.1642, 101.590])  # m


class Variant(StrEnum):
    PLAIN = "plain"
    STEP = "step"  # of area, hence of impedance, at a third of its length
    FRICTION = "friction"  # depends on frequency


class WaveLine(NamedTuple):
    """A feed line with travelling waves; inertance and volume as a whole are the injector's."""

    damping: float = 2.0  # m2/s, of waves
    wide_elements: int = 0  # at the far end, of another area
    area_ratio: float = 1.0  # of these to the others
    viscosity: float = 0.0  # m2/s, of the friction that remembers; 0: none
    end_share: float = 0.013  # of the line's volume, as gallery in front of the seat
    elements: int = 12
    taper: float = 0.0  # of the area, from the rail to the seat, as share of its mean
    inlet_ratio: float = 1.0  # of the first element's area to the others: a room behind the rail
    inlet_loss: float = 0.0  # Pa s2/m6, of an orifice between rail and line
    smooth_flow: float = 0.0  # m3/s, at which a smooth wall resists as the injector says; 0: a rough one


LINES = {
    Variant.PLAIN: WaveLine(),
    Variant.STEP: WaveLine(wide_elements=8, area_ratio=1.5),
    Variant.FRICTION: WaveLine(damping=0.5, viscosity=6e-6),
}


def new_part() -> Injector:
    return Injector(sac_volume=SAC_VOLUME, drained_by_seat=1)


def real_part(seed: int, part: Injector | None = None) -> Injector:
    """The injector on the bench: stiffness, loss, flow coefficients and sac differ from the maker's."""
    rng = np.random.default_rng([seed, 0x7E57])
    stiffness, loss, seat, nozzle, sac = (1.0 + HIDDEN_SHARE * rng.uniform(-1.0, 1.0, 5)).tolist()
    part = part or new_part()
    return part._replace(
        bulk_modulus_line=part.bulk_modulus_line * stiffness,
        bulk_modulus_sac=part.bulk_modulus_sac * stiffness,
        line_loss=part.line_loss * loss,
        seat_coefficient=part.seat_coefficient * seat,
        nozzle_area=part.nozzle_area * nozzle,
        sac_volume=part.sac_volume * sac,
    )


def lattice_of(part: Injector, faults: Faults, line: WaveLine, step: float) -> Lattice:
    """The line in elements, its friction for steps of `step` [s]."""
    area = np.ones(line.elements)
    area[line.elements - line.wide_elements :] = line.area_ratio
    area[0] *= line.inlet_ratio
    area *= 1.0 + line.taper * ((np.arange(line.elements) + 0.5) / line.elements - 0.5)
    inertance = part.density * part.line_length * (1.0 + faults.line_inertance) / part.line_area
    share = 1.0 / area / np.sum(1.0 / area)
    inertances = inertance * share
    volumes = part.line_volume * (1.0 - line.end_share) * area / np.sum(area)
    areas = part.line_area * np.mean(1.0 / area) * area
    stiffness = part.bulk_modulus_line * (1.0 + faults.bulk_modulus) + part.stiffening * STIFFNESS_PRESSURE
    length = part.line_length / line.elements
    rates = line.viscosity * math.pi / areas
    active = KAGAWA_RATES if line.viscosity > 0.0 else np.empty(0)
    shares = KAGAWA_SHARES if line.viscosity > 0.0 else np.empty(0)
    return Lattice(
        inertance=inertances,
        volume=volumes,
        impedance=np.sqrt(inertances * stiffness / volumes),
        loss=part.line_loss * (1.0 + faults.line_friction) / (2.0 * areas * part.line_length),
        stress=inertances * line.damping / length**2,
        kept=np.exp(-np.outer(rates, active) * step),
        added=shares * np.exp(-0.5 * np.outer(rates, active) * step),
        pull=4.0 * rates,  # the fluid's own, whatever is deposited
        end_volume=part.line_volume * line.end_share,
        inlet_loss=line.inlet_loss * (1.0 + faults.fuel_density),
        dense=EVEN if part.stiffening == 0.0 else np.array([density_share(p * MEGAPASCAL, part) for p in range(400)]),
        smoothness=line.smooth_flow**0.25,
    )


class WavePlant:
    """An injector on a line with waves, at rest at first."""

    def __init__(
        self, part: Injector, line: WaveLine, rail_pressure: float, steps: int = STEPS, laws: Laws = NO_LAWS
    ) -> None:
        n = line.elements * NODES
        parts = KAGAWA_RATES.size if line.viscosity > 0.0 else 0
        self._part, self._line, self._steps, self._laws = part, line, steps, laws
        self.state = WaveState(
            np.concatenate((np.zeros(n), np.full(n + 1, rail_pressure))),
            np.zeros((n, parts)),
            np.array([part.chamber_pressure, rail_pressure, 0.0, 0.0]),
            np.array([*np.zeros(n), rail_pressure, 0.0]),
        )

    def advance(self, faults: Faults, strokes: Array, drive: Rail, result: Array) -> None:
        """Signals (n, 6) of `equations.run` at the samples after the first of `drive`."""
        part = with_faults(self._part, faults)
        usual = lattice_of(part, faults, self._line, drive.interval / self._steps)
        lattice = usual._replace(inertance=usual.inertance.copy(), loss=usual.loss.copy())
        laws, beyond = self._laws, self._laws != NO_LAWS
        run_wave(usual, lattice, part, faults, laws, beyond, strokes, drive, self.state, self._steps, result)
