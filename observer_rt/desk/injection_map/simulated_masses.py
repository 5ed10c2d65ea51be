"""Masses of single shots by the package's own simulation, from rest, of the needle that the injector file states."""

import math

import numpy as np

from observer_rt.desk.simulation.plant import run_plant
from observer_rt.desk.simulation.schedule import Shot, stroke
from observer_rt.foundation.units import Floats
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters

BEFORE, AFTER = 0.2e-3, 0.5e-3  # s that are simulated before energizing, and after the needle has landed
SAMPLE_RATE = 50e3  # Hz of simulated rates


def masses_of(injector: InjectorParameters, rail_pressures: Floats, durations: Floats) -> Floats:
    """Masses (n,) [kg] of single shots at rail pressures [Pa] and energizing times [s]."""
    model = effective_model(injector)
    points = zip(rail_pressures.tolist(), durations.tolist(), strict=True)
    return np.array([_mass(model, pressure, duration) for pressure, duration in points])


def _mass(model: EffectiveModel, rail_pressure: float, energizing: float) -> float:
    """Mass [kg] of a single shot [s] at a rail pressure [Pa]."""
    made = stroke(Shot(energizing), BEFORE, rail_pressure, model.injector)
    if made is None:
        return 0.0
    time = np.arange(math.ceil((made.landed + AFTER) * SAMPLE_RATE) + 1) / SAMPLE_RATE
    truth = run_plant(model, [made], time, np.full(time.size, rail_pressure))
    return float(truth.injection_rate.sum()) / SAMPLE_RATE * model.injector.fluid.density_nozzle
