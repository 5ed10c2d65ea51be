"""Plants of discovery's tier B: unlike each other, blind, true to the vocabulary; old ones unchanged."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.model.effects import VOCABULARY
from tests.plants.laws import NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Outcome, Shot, Surroundings, record
from tests.plants.wave import LINES, Variant, WaveLine, new_part, real_part
from tools.benchmarks.discovery.cases import real_benches, real_case
from tools.benchmarks.discovery.discrepancies import Discrepancy, plant_of
from tools.benchmarks.discovery.rigs import FURTHER, GIVEN, Rig, healthy_benches
from tools.benchmarks.discovery.vocabulary import EFFECTS, OUTSIDE, PAIRS

STRUCTURES = {"seat_outflow"}
SEVERAL_FAULTS = Faults(
    orifice_area=0.1,
    guide_leakage=2e-14,
    seat_lift_loss=0.2,
    line_friction=0.3,
    channel_skew=13e-6,
    line_pressure_sensor_lag=5e-6,
    entrained_air=1e-3,
)
NOTHING_ELSE = Surroundings()
BEFORE = {
    None: (0.006942198538450987, 399837045000.0, 7661614.087476721),
    Variant.PLAIN: (0.00664627819060693, 399859775000.0, 3775682.2872905787),
    Variant.STEP: (0.006622109491546135, 399842025000.0, 4395929.794300052),
    Variant.FRICTION: (0.006633584184832779, 399860625000.0, 3704756.5132302246),
}
"""Sums of rate and line pressure, and the pressure's swing, before plants had what tier B of discovery
needs; of the wall friction since deposits do not change it: it is the fuel's."""


def short(
    part: Injector,
    line: WaveLine | None,
    faults: Faults = SEVERAL_FAULTS,
    around: Surroundings = NOTHING_ELSE,
    duration: float = 0.6e-3,
    noise: float = 1.0,
    laws: Laws = NO_LAWS,
) -> Outcome:
    """Two openings within 40 ms."""
    events = (Event(100e6, (Shot(3e-6, duration),), faults),) * 2
    around = replace(around, starts=(0.01, 0.02))
    return record(Bench(part, Needle(), events, seed=3, line=line, around=around, noise=noise, laws=laws))


@pytest.mark.parametrize("variant", BEFORE)
def test_plants_of_other_benchmarks_are_as_before(variant: Variant | None) -> None:
    part, line = (Injector(), None) if variant is None else (real_part(1), LINES[variant])
    outcome = short(part, line)
    assert (
        float(np.sum(outcome.truth.injection_rate)),
        float(np.sum(outcome.measured.line_pressure)),
        float(np.std(outcome.truth.line_pressure[1100:2200])),
    ) == pytest.approx(BEFORE[variant], rel=1e-10)


@pytest.mark.parametrize("discrepancy", Discrepancy)
def test_every_discrepancy_is_one(discrepancy: Discrepancy) -> None:
    plant = plant_of(discrepancy, 1)
    nominal = new_part()
    plain = plant.part._replace(
        line_length=nominal.line_length,
        line_volume=nominal.line_volume,
        line_loss=plant.part.line_loss * nominal.line_length / plant.part.line_length,
    )
    here = short(plant.part, plant.line, Faults(), Surroundings(before_noise=plant.mounting), noise=0.0)
    without = short(plain, LINES[Variant.PLAIN], Faults(), noise=0.0)
    assert all(np.isfinite(values).all() for values in vars(here.measured).values())
    off = np.max(np.abs(here.measured.line_pressure - without.measured.line_pressure))
    assert bool(off > 0.3e6) is (discrepancy is not Discrepancy.PLAIN)


def test_an_orifice_behind_the_rail_takes_its_pressure() -> None:
    part, line = new_part(), LINES[Variant.PLAIN]
    loss = 1e15  # Pa s2/m6

    def mean_pressure(line: WaveLine) -> float:
        outcome = short(part, line, Faults(), duration=4e-3, noise=0.0)
        return float(np.mean(outcome.truth.line_pressure[1150:1350]))

    flow = float(np.mean(short(part, line, Faults(), duration=4e-3).truth.injection_rate[1150:1350]))
    taken = mean_pressure(line) - mean_pressure(line._replace(inlet_loss=loss))
    assert taken == pytest.approx(loss * flow**2, rel=0.15)


def test_effects_are_those_of_the_vocabulary_within_its_bounds() -> None:
    assert set(EFFECTS) == set(VOCABULARY) - STRUCTURES
    assert not set(OUTSIDE) & set(VOCABULARY)
    assert len(OUTSIDE) >= 5
    assert {name for pair in PAIRS for name in pair} <= set(EFFECTS)
    for name, effect in EFFECTS.items():
        vocabulary = VOCABULARY[name].parameters
        assert [p.name for p in effect.parameters] == [p.name for p in vocabulary]
        for drawn, bounds in zip(effect.parameters, vocabulary, strict=True):
            assert drawn.highest <= bounds.highest
            assert bounds.lowest <= (drawn.most_negative or drawn.lowest)
            assert drawn.most_negative == 0.0 or bounds.lowest < 0.0


def test_given_and_further_recordings_share_plant_and_faults_and_nothing_else() -> None:
    rig = Rig(Discrepancy.TAPER, False, 1)
    case = real_case(("seat_area",), rig, 0)
    shown, further, healthy = (
        real_benches(case, GIVEN),
        real_benches(case, FURTHER, 0.0),
        [*healthy_benches(rig)],
    )
    assert {b.events[0].faults for b in shown + further} == {EFFECTS["seat_area"].faults(case.parts[0][1])}
    assert {b.events[0].faults for b in healthy} == {Faults()}
    assert len({(b.injector, b.needle, b.line) for b in shown + further + healthy}) == 1
    assert len({b.seed for b in shown + further + healthy}) == len(shown + further + healthy)
    assert not {b.events[0].rail_pressure for b in shown} & {b.events[0].rail_pressure for b in further}
    assert {b.noise for b in further} == {0.0}
