"""Masses of independent plants whose sensors and lines are drawn from the accuracies that are stated of them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import Generator
from numpy.typing import NDArray

from observer_rt.model.accuracy import Accuracy
from tests.engine.plant_runs import EVENTS, RAIL_PRESSURES, in_turn
from tests.observed_plants import ObservedRun, bench_at, observed
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Needle, Surroundings

SENSORS = 0.7  # %
LINE = Accuracy(line_diameter_percent=1.0, line_length_percent=0.5, parallel_flow_percent=0.0)
KNOWN = Accuracy(line_diameter_percent=0, line_length_percent=0, fuel_density_percent=0, parallel_flow_percent=0)
FALLS, RECOVERS, DIP = 0.8e-3, 6e-3, 2e6  # s, s, Pa: of a rail that feeds an injection


def seen(
    faults: Faults,
    injector: Injector,
    accuracy: Accuracy,
    *,
    pressures: tuple[float, ...] = RAIL_PRESSURES,
    dips: bool = False,
    seed: int = 1,
) -> ObservedRun:
    plant = Bench(injector, Needle(), in_turn(EVENTS, lambda _: faults, pressures), seed=seed)

    def dip(time: NDArray[np.float64]) -> NDArray[np.float64]:
        total = np.zeros_like(time)
        for start in plant.starts[:-1]:
            since = np.maximum(time - start, 0.0)
            total -= DIP * (np.exp(-since / RECOVERS) - np.exp(-since / FALLS))
        return total

    if dips:
        plant = replace(plant, around=Surroundings(supply=(dip,)))
    bench = bench_at(plant.sample_rate, accuracy_percent=SENSORS)
    return observed(plant, bench.with_parameters(bench.injector.parameters.model_copy(update={"accuracy": accuracy})))


def drawn(random: Generator) -> Faults:
    return Faults(
        orifice_area=random.uniform(-0.2, 0.3),
        seat_area=random.uniform(-0.15, 0.2),
        line_pressure_sensor_gain=0.01 * SENSORS * random.normal(),
        rail_pressure_sensor_gain=0.01 * SENSORS * random.normal(),
        line_pressure_sensor_offset=0.3e6 * random.normal(),
    )


@pytest.mark.parametrize(
    ("faults", "pressures", "dips"),
    [
        (Faults(line_pressure_sensor_gain=0.012), RAIL_PRESSURES, False),
        (Faults(rail_pressure_sensor_gain=-0.01), RAIL_PRESSURES, True),
        (Faults(line_pressure_sensor_gain=-0.01, line_pressure_sensor_offset=0.4e6), (100e6,), False),
    ],
    ids=["line", "rail that dips", "at one pressure, with an offset"],
)
def test_a_gain_within_accuracy_is_in_the_interval(faults: Faults, pressures: tuple[float, ...], dips: bool) -> None:
    run = seen(faults, Injector(), KNOWN, pressures=pressures, dips=dips)
    assert all(report.valid for report in run.reports[3:])  # the third pressure is new
    assert sum(run.inside) >= len(run.inside) - 1
    for report, true in zip(run.reports[4:], run.true[4:], strict=True):
        assert report.mass_bound < 0.021 * true


def test_a_bore_that_nobody_knows_better_is_in_the_interval() -> None:
    part = Injector()
    run = seen(Faults(), part._replace(line_area=part.line_area * 1.015**2), LINE)
    assert np.all(np.abs(run.errors[4:]) > 0.02)  # nothing shows it
    assert all(report.valid for report in run.reports[3:])
    assert all(run.inside)


@pytest.mark.slow
def test_coverage_of_drawn_benches() -> None:
    random, inside, valid = np.random.default_rng(57), [], 0
    for number in range(40):
        part = Injector()
        by_bore, by_length = 0.01 * random.normal(), 0.005 * random.normal()
        part = part._replace(
            line_area=part.line_area * (1.0 + by_bore) ** 2, line_length=part.line_length * (1.0 + by_length)
        )
        pressures = RAIL_PRESSURES if number % 2 else (float(random.choice(RAIL_PRESSURES)),)
        run = seen(drawn(random), part, LINE, pressures=pressures, dips=number % 4 > 1, seed=number)
        inside += run.inside
        valid += sum(report.valid for report in run.reports[2:])
    assert valid >= 0.9 * 40 * (EVENTS - 2)
    assert np.mean(inside) >= 0.9  # a bore beyond two sigma is outside in all its events
