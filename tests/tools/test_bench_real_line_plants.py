"""Plants of discovery's tier B: unlike each other, blind, true to the vocabulary."""

import numpy as np
import pytest

from observer_rt.model.effects import VOCABULARY
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Outcome, Shot, Step, Surroundings, record
from tests.plants.wave import LINES, Variant, WaveLine, new_part
from tools.benchmarks.discovery.cases import real_benches, real_case
from tools.benchmarks.discovery.discrepancies import Discrepancy, plant_of
from tools.benchmarks.discovery.rigs import FURTHER, GIVEN, Rig, healthy_benches
from tools.benchmarks.discovery.vocabulary import EFFECTS, OUTSIDE, PAIRS

NOT_HIDDEN = {"seat_outflow", "control_flow"}  # a structure; a law of the plants


def short(part: Injector, line: WaveLine | None, mounting: tuple[Step, ...] = ()) -> Outcome:
    """Two openings within 40 ms, without noise."""
    around = Surroundings(starts=(0.01, 0.02), before_noise=mounting)
    events = (Event(100e6, (Shot(3e-6, 0.6e-3),), Faults()),) * 2
    return record(Bench(part, Needle(), events, seed=3, line=line, around=around, noise=0.0))


@pytest.mark.parametrize("discrepancy", Discrepancy)
def test_every_discrepancy_is_one(discrepancy: Discrepancy) -> None:
    plant = plant_of(discrepancy, 1)
    nominal = new_part()
    plain = plant.part._replace(
        line_length=nominal.line_length,
        line_volume=nominal.line_volume,
        line_loss=plant.part.line_loss * nominal.line_length / plant.part.line_length,
    )
    here = short(plant.part, plant.line, plant.mounting)
    without = short(plain, LINES[Variant.PLAIN])
    assert all(np.isfinite(values).all() for values in vars(here.measured).values())
    off = np.max(np.abs(here.measured.line_pressure - without.measured.line_pressure))
    assert bool(off > 0.3e6) is (discrepancy is not Discrepancy.PLAIN)


def test_effects_are_those_of_the_vocabulary_within_its_bounds() -> None:
    assert set(EFFECTS) == set(VOCABULARY) - NOT_HIDDEN
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
