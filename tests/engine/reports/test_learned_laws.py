"""Laws that the network learned, with their intervals, against those of plants by other equations."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest

from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.engine.learning.knowledge import no_knowledge
from observer_rt.engine.reports.learned_laws import LearnedLaw, furthest, leading, learned_laws
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND, Floats
from observer_rt.model.effects import effective_model
from tests.engine.plant_runs import DURATIONS, HEALTHY, RAIL_PRESSURES, in_turn
from tests.engine.sample_stream import NOISE
from tests.observed_plants import bench_at, recording_of
from tests.plants.laws import COKING_TIME, REFERENCE, TEN_PRODUCTS, Laws
from tests.plants.parameters import Injector
from tests.plants.plant import Bench, Needle, record

Curve = Callable[[Floats], Floats]


def curves_after(laws: Laws, rails: tuple[float, ...] = RAIL_PRESSURES) -> Mapping[tuple[str, str], LearnedLaw]:
    """Curves learned from 15 injections of an injector with such laws, by flow and variable."""
    plant = Bench(Injector(), Needle(), in_turn(15, lambda _: HEALTHY, rails), seed=37, laws=laws)
    bench = bench_at(plant.sample_rate)
    knowledge = evaluate(bench, [recording_of(record(plant))]).knowledge
    curves = learned_laws(knowledge, effective_model(bench.injector.parameters).coefficients)
    assert not any(curve.is_surface for curve in curves)
    return {(curve.flow, curve.variables[0]): curve for curve in curves}


@pytest.mark.parametrize(
    ("laws", "variable", "truth"),
    [
        (Laws(rail_growth=0.3), "rail_pressure_MPa", lambda p: 0.3 * (p * MEGAPASCAL / REFERENCE - 1.0)),
        (Laws(coking=0.3), "time_since_opening_ms", lambda t: 0.3 * np.expm1(-t * MILLISECOND / COKING_TIME)),
    ],
)
def test_a_law_of_the_nozzle_is_within_its_interval(laws: Laws, variable: str, truth: Curve) -> None:
    curves = curves_after(laws)
    curve = furthest(curves.values())
    assert curve is curves["orifice_area", variable]
    true = truth(*curve.inputs)
    assert np.ptp(true) > 0.1
    assert np.mean(np.abs(curve.change - true) <= curve.half_width) > 0.8
    assert np.abs(curve.change - true).max() < 0.25 * np.ptp(true)


def test_a_healthy_injector_has_flat_curves_over_what_varied() -> None:
    curves = curves_after(Laws(), RAIL_PRESSURES[:1])
    assert ("orifice_area", "rail_pressure_MPa") not in curves
    assert {flow for flow, _ in curves} == {"orifice_area", "seat_area"}
    for curve in curves.values():
        assert (np.abs(curve.change) <= 2.0 * curve.half_width).all()


def test_there_are_none_before_an_event() -> None:
    c = effective_model(bench_at(100e3).injector.parameters).coefficients
    assert learned_laws(no_knowledge(NOISE, c.pressure_scale), c) == ()


def test_a_law_of_two_inputs_at_once_is_learned_as_a_surface() -> None:
    laws, _ = TEN_PRODUCTS["nozzle by rail pressure and time"]
    plant = Bench(Injector(), Needle(), in_turn(24, lambda _: HEALTHY, RAIL_PRESSURES, DURATIONS), seed=37, laws=laws)
    (evaluation,) = evaluate(bench_at(plant.sample_rate), [recording_of(record(plant))]).evaluations
    assert all(report.valid for report in evaluation.reports[12:])
    assert np.mean([abs(late.remainder) <= 2.0 * late.relative_sigma for late in evaluation.reports[12:]]) > 0.8
    surface = leading(evaluation.learned)
    assert surface is not None
    assert surface.variables == ("rail_pressure_MPa", "time_since_opening_ms")
    rails, times = np.meshgrid(*surface.inputs, indexing="ij")
    true = laws.nozzle_product * np.tanh((rails - 100.0) / 30.0) * np.tanh((times - 0.8) / 0.4)
    assert 0.3 < np.mean(surface.is_seen) < 1.0
    assert np.corrcoef(surface.change[surface.is_seen], true[surface.is_seen])[0, 1] > 0.8
    assert surface.words.startswith("learned: nozzle flow by rail pressure and time since opening, ")
