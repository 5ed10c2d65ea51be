"""Realistic injectors: converged, with fuel that stiffens and grows denser as theory says, filtered, in 14 bits."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from tests.plants.equations import Rail, density_share, line_stiffness
from tests.plants.parameters import Faults
from tests.plants.plant import LINE, SAMPLE_RATE, record, strokes_of
from tests.plants.real import BITS, CORNER, WHOLE, RealInjector, Setting, real_injector
from tests.plants.test_plant import ringing_frequency
from tests.plants.wave import WavePlant
from tests.plants.wave_equations import STEPS

pytestmark = pytest.mark.slow


def injected(injector: RealInjector, steps: int, elements: int) -> float:
    """Volume [m3] of an opening at the highest pressure, in `steps` a sample and so many elements."""
    bench = injector.bench(injector.points[-1:], injector.faults, np.random.default_rng(1))
    event, rail = bench.events[0], injector.points[-1][0]
    strokes = strokes_of(event, 0.0, injector.needle, injector.part.max_lift)
    line = injector.line._replace(elements=elements)
    plant, result = WavePlant(injector.part, line, rail, steps, injector.laws), np.empty((800, 6))
    plant.advance(injector.faults, strokes, Rail(-5e-4, 1e-5, np.full(801, rail)), result)
    return float(np.sum(result[:, 0])) / SAMPLE_RATE


@pytest.mark.parametrize("setting", WHOLE)
def test_half_the_step_and_half_the_elements_change_no_mass(setting: Setting) -> None:
    injector = real_injector(setting, 1)
    usual = injected(injector, STEPS, injector.line.elements)
    assert injected(injector, 2 * STEPS, 2 * injector.line.elements) == pytest.approx(usual, rel=1e-3)


def test_density_is_what_the_stiffness_makes_of_it() -> None:
    part = real_injector(Setting.FUEL, 1).part
    grown, _ = quad(lambda p: 1.0 / (part.bulk_modulus_line + part.stiffening * p), 0.0, 150e6)
    assert density_share(150e6, part) == pytest.approx(math.exp(grown))
    stiffness = part.bulk_modulus_line + part.stiffening * 150e6
    assert line_stiffness(150e6, part, Faults()) == pytest.approx(stiffness / density_share(150e6, part))


def test_a_line_rings_faster_the_higher_its_pressure() -> None:
    injector = real_injector(Setting.FUEL, 1)
    rng = np.random.default_rng(1)

    def frequency(pressure: float) -> float:
        return ringing_frequency(record(injector.bench([(pressure, 1e-3)], injector.faults, rng)))

    def speed(pressure: float) -> float:
        return math.sqrt(line_stiffness(pressure, injector.part, Faults()))

    assert frequency(150e6) / frequency(60e6) == pytest.approx(speed(150e6) / speed(60e6), rel=0.01)


def test_channels_have_a_filter_of_two_poles_and_steps_of_14_bits() -> None:
    injector = real_injector(Setting.FILTERS, 1)
    bench = injector.bench(injector.points[:1] * 2, injector.faults, np.random.default_rng(1))
    line = record(bench).measured.line_pressure
    spectrum = np.abs(np.fft.rfft(line[:10_000] - line[:10_000].mean())) ** 2
    corner = round(CORNER / SAMPLE_RATE * 10_000)
    share = np.mean(spectrum[corner - 100 : corner + 100]) / np.mean(spectrum[500:1500])
    assert share == pytest.approx(0.5, rel=0.25)
    assert np.min(np.diff(np.unique(line))) > 0.6 * BITS[LINE]
