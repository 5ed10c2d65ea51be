"""Healthy recordings of an injector that the file describes wrongly, for the tests of the fit."""

from collections.abc import Sequence

import numpy as np

from observer_rt.config.bench import load_injector
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, Simulation, simulate
from observer_rt.files.signals.recording import Recording
from observer_rt.identification.fit.forms import LOSS, NOZZLE, SEAT, STIFFNESS, STRUCTURES, with_values
from observer_rt.model.effect import SizedEffect
from observer_rt.model.parameters import InjectorParameters
from tests.observed_plants import recording_of
from tests.plants import plant
from tests.plants.laws import NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector

NOMINAL = load_injector()
WRONG = (STIFFNESS, LOSS, SEAT, NOZZLE)
SHARES = np.array([0.9, 1.1, 1.1, 0.9])
HEALTHY = Faults()
LUMPS = tuple(one for one in STRUCTURES if one.line == "lump")
POINTS = tuple((pressure, time) for pressure in (60e6, 100e6, 140e6) for time in (0.6e-3, 1.9e-3))


def off_by_ten_percent(injector: InjectorParameters = NOMINAL) -> InjectorParameters:
    """An injector file in which K_L, xi, alpha_S and alpha_H are 10 % wrong."""
    return with_values(injector, WRONG, SHARES * [one.of(injector) for one in WRONG])


def simulations(
    points: Sequence[tuple[float, float]] = POINTS,
    injector: InjectorParameters = NOMINAL,
    measured_rate: bool = False,
    injections: int = 3,
    seed: int = 1,
    noise: SimulatedNoise | None = SimulatedNoise(),  # noqa: B008
    effects: Sequence[SizedEffect] = (),
    period: float = 0.05,
) -> list[Simulation]:
    """One an operating point (rail pressure [Pa], energizing [s])."""
    return [
        simulate(
            injector,
            make_schedule([pressure], injections, period, [duration]),
            100e3,
            effects,
            noise,
            measured_rate,
            seed=100 * seed + number,
        )
        for number, (pressure, duration) in enumerate(points)
    ]


def of_independent_plant(
    part: Injector, points: Sequence[tuple[float, float]] = POINTS, faults: Faults = HEALTHY, laws: Laws = NO_LAWS
) -> list[Recording]:
    """Recordings of a plant, which shares no code with the package."""
    result = []
    for number, (pressure, duration) in enumerate(points):
        event = plant.Event(pressure, (plant.Shot(0.0, duration + 0.3e-3),), faults)
        bench = plant.Bench(part, plant.Needle(), (event,) * 3, seed=number, laws=laws)
        result.append(recording_of(plant.record(bench)))
    return result
