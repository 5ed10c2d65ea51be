"""The richer plant: independent of the package, converged, conserving, ringing as theory says; and its recordings."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from tests.plants.equations import Rail
from tests.plants.parameters import Faults
from tests.plants.plant import Bench, Event, Needle, Outcome, Shot, record, strokes_of
from tests.plants.test_plant import ringing_frequency
from tests.plants.wave import KAGAWA_RATES, KAGAWA_SHARES, LINES, Variant, WaveLine, WavePlant, lattice_of, new_part
from tests.plants.wave_equations import STEPS

EVENT = Event(100e6, (Shot(0.0, 1.2e-3),), Faults())
pytestmark = pytest.mark.slow


def once(line: WaveLine) -> Outcome:
    return record(Bench(new_part(), Needle(), (EVENT,), noise=0.0, line=line))


def fine(line: WaveLine, steps: int, samples: int = 200) -> tuple[NDArray[np.float64], WavePlant]:
    """Signals of one opening at the start of 2 ms at a steady rail, in `steps` a sample."""
    event = replace(EVENT, rail_pressure=120e6)
    strokes = strokes_of(event, 0.0, Needle(), new_part().max_lift)
    plant = WavePlant(new_part(), line, event.rail_pressure, steps)
    result = np.empty((samples, 6))
    plant.advance(Faults(), strokes, Rail(-5e-5, 1e-5, np.full(samples + 1, event.rail_pressure)), result)
    return result, plant


@pytest.mark.parametrize("variant", Variant)
def test_neither_finer_steps_nor_finer_elements_change_anything(variant: Variant) -> None:
    line = LINES[variant]
    usual, _ = fine(line, STEPS)
    finer = line._replace(elements=2 * line.elements, wide_elements=2 * line.wide_elements)
    for compared, _ in (fine(line, 4 * STEPS), fine(finer, 4 * STEPS)):
        assert np.sum(usual[:, 0]) == pytest.approx(np.sum(compared[:, 0]), rel=1e-5)
        assert np.max(np.abs(usual[:, 0] - compared[:, 0])) < 0.03e-6
        assert np.max(np.abs(usual[:, 3] - compared[:, 3])) < 0.05e6


@pytest.mark.parametrize("variant", Variant)
def test_what_the_rail_gives_is_injected_or_stored(variant: Variant) -> None:
    part, line, rail, step = new_part(), LINES[variant], 100e6, 0.5e-6
    strokes = strokes_of(EVENT, 0.0, Needle(), part.max_lift)
    lattice = lattice_of(part, Faults(), line, step)
    plant = WavePlant(part, line, rail, 1)
    n = plant.state.line.size // 2
    supplied, injected, result = [0.0], [0.0], np.empty((1, 6))
    for k in range(3200):
        plant.advance(Faults(), strokes, Rail(-5e-5 + k * step, step, np.full(2, rail)), result)
        y = plant.state.line
        supplied.append(y[0] + (rail - y[n]) / lattice.impedance[0])
        injected.append(result[0, 0])
    weights = np.tile(np.array([1.0, 5.0, 5.0, 1.0]) / 12.0, line.elements)
    swelling = (y[n : 2 * n] - rail) * weights * np.repeat(lattice.volume, 4)
    stored = (np.sum(swelling) + (y[2 * n] - rail) * lattice.end_volume) / part.bulk_modulus_line
    assert step * np.trapezoid(injected) > 4e-8
    assert step * np.trapezoid(supplied) == pytest.approx(step * np.trapezoid(injected) + stored, rel=2e-5)


@pytest.mark.parametrize("variant", [Variant.PLAIN, Variant.STEP])
def test_line_rings_as_its_two_parts_and_gallery_must(variant: Variant) -> None:
    line, part = LINES[variant], new_part()
    lattice = lattice_of(part, Faults(), line, 1e-6)
    narrow = (line.elements - line.wide_elements) if line.wide_elements else line.elements // 2
    z = lattice.impedance[0], lattice.impedance[-1]
    travel = np.cumsum(lattice.impedance * lattice.volume / part.bulk_modulus_line)
    compliance = lattice.end_volume / part.bulk_modulus_line

    def mismatch(omega: float) -> float:
        """Of the impedance of the near part, seen through the far one, with that of the gallery."""
        turn = math.tan(omega * (travel[-1] - travel[narrow - 1]))
        near = z[0] * math.tan(omega * travel[narrow - 1])
        seen = z[1] * (near + z[1] * turn) / (z[1] - near * turn)
        return float(1.0 / seen - omega * compliance)

    omega = brentq(mismatch, 9e3, 14e3)
    assert ringing_frequency(once(line)) == pytest.approx(omega / (2.0 * math.pi), rel=2e-3)
    if variant is Variant.PLAIN:
        assert omega == pytest.approx(8037.0 * math.pi / 2.0, rel=0.02)


def test_remembered_friction_has_zielkes_weights() -> None:
    for time in (1e-5, 1e-4, 1e-3, 1e-2):
        root = math.sqrt(time)
        zielke = 0.282095 / root - 1.25 + 1.057855 * root + 0.9375 * time + 0.396696 * time * root
        assert np.sum(KAGAWA_SHARES * np.exp(-KAGAWA_RATES * time)) == pytest.approx(zielke, rel=0.02)


def test_remembered_friction_damps_as_its_boundary_layer_must() -> None:
    line = LINES[Variant.FRICTION]
    radius = math.sqrt(new_part().line_area / math.pi)
    omega = 2.0 * math.pi * ringing_frequency(once(line))
    internal = 0.5 * line.damping * (0.5 * math.pi / new_part().line_length) ** 2
    layer = math.sqrt(0.5 * line.viscosity * omega) / radius  # half of its resistance over inertance

    def decay(line: WaveLine) -> float:
        outcome = once(line)
        swing = np.abs(outcome.truth.line_pressure - 100e6)[int(outcome.openings[0, 1]) :]
        return float(np.log(np.max(swing[900:1100]) / np.max(swing[1900:2100])) / 0.01)

    without = decay(line._replace(viscosity=0.0))
    assert decay(line) - without == pytest.approx(layer, rel=0.25)
    assert without > internal
