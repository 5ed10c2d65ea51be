"""A line in which pressure travels: found, distinguished from a lump, its cells as its sound speed wants them."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.core.model.model import STEP
from observer_rt.identification.fit.calibrate import CalibrationResult, calibrate
from observer_rt.identification.fit.fitted_file import baseline_of
from observer_rt.identification.fit.forms import SAC, STIFFNESS, STRUCTURES, Structure, values_of, with_values
from observer_rt.identification.fit.search import FailedStructure
from observer_rt.identification.fit.structures import judged_by
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effective import coefficients
from observer_rt.model.parameters import InjectorParameters, LineOutflow
from tests.engine.plant_runs import in_turn
from tests.identification.fit.healthy import NOMINAL, of_independent_plant, off_by_ten_percent
from tests.observed_plants import bench_at, observed, recording_of
from tests.plants.healthy import healthy_benches
from tests.plants.laws import NINE_LAWS
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot, Surroundings, record, wave_injector
from tests.plants.wave import LINES, Variant, WaveLine, real_part

pytestmark = pytest.mark.slow  # compiles what only these tests call, or is a whole closed loop

SMALL_SAC = with_values(NOMINAL, (SAC,), np.array([3e-9]))
WAVES = tuple(one for one in STRUCTURES if one.line == "wave")


@pytest.fixture(scope="module")
def travelling() -> CalibrationResult:
    """Six recordings of an independent plant with 40 cells, drained by the seat into a sac of 3 mm3."""
    measured = measurements(of_independent_plant(wave_injector()))
    return calibrate(off_by_ten_percent(SMALL_SAC), measured, {}, lambda _: None)


def test_waves_drained_by_the_seat_are_chosen_and_adequate(travelling: CalibrationResult) -> None:
    assert (travelling.fitted.structure.line, travelling.fitted.structure.outflow) == ("wave", LineOutflow.SEAT)
    assert travelling.inadequate == ()
    assert judged_by(travelling.choice.best).mean < 1.2


def test_the_numbers_of_another_discretisation_are_near(travelling: CalibrationResult) -> None:
    """Its end cell has a volume of its own, which is ours to some mm3: hence the stiffness to two percent."""
    fitted = travelling.injector
    assert fitted.fluid.bulk_modulus_line == pytest.approx(1.6e9, rel=0.02)
    assert fitted.nozzle.flow_coefficient == pytest.approx(0.78, rel=0.005)
    assert fitted.seat.flow_coefficient == pytest.approx(0.75, rel=0.02)
    assert fitted.line.loss_factor == pytest.approx(8.0, rel=0.03)


def calibrated_to(
    plant: WaveLine, part: Injector | None = None, file: InjectorParameters = SMALL_SAC
) -> CalibrationResult:
    """A plant that knows nothing of our cells, explained by waves drained by the seat; part: on it, a file of it."""
    healthy = healthy_benches(Variant.PLAIN, 1).values()
    benches = [replace(one, line=plant, injector=part or one.injector) for one in healthy]
    measured = measurements([recording_of(record(bench)) for bench in benches])
    by_seat = [one for one in WAVES if one.outflow is LineOutflow.SEAT]
    done = calibrate(file, measured, {}, lambda _: None, by_seat if part is None else by_seat[:1])
    assert done.inadequate == ()
    return done


def test_a_fuel_that_stiffens_is_found_by_a_file_of_one_that_does_not() -> None:
    """By its waves: how their speed grows, (K_1 - 1)/K for a fuel, n/K for the plant's, whose density is constant."""
    stiffens = Faults(bulk_modulus_slope=10.5)
    benches = [
        replace(one, events=tuple(replace(event, faults=stiffens) for event in one.events))
        for one in healthy_benches(Variant.PLAIN, 1).values()
    ]
    measured = measurements([recording_of(record(bench)) for bench in benches])
    done = calibrate(SMALL_SAC, measured, {}, lambda _: None, WAVES)
    assert done.inadequate == ()
    fluid, plant = done.injector.fluid, real_part(1).bulk_modulus_line / (1.0 - LINES[Variant.PLAIN].end_share)
    stiffness = fluid.bulk_modulus_line + fluid.bulk_modulus_by_pressure * 100e6
    assert (fluid.bulk_modulus_by_pressure - 1.0) / stiffness == pytest.approx(10.5 / plant, rel=0.03)


def test_a_throttle_at_the_rail_is_found() -> None:
    """An orifice of 2e14 Pa s2/m6 before the line."""
    injector = calibrated_to(LINES[Variant.PLAIN]._replace(inlet_loss=2e14)).injector
    line, density = injector.line, injector.fluid.density_line
    assert line.wall_viscosity is None
    assert line.inlet_loss_factor is not None
    assert line.inlet_loss_factor * density / (2.0 * line.area**2) == pytest.approx(2e14, rel=0.05)


def test_a_long_line_may_still_ring_when_the_next_injection_comes() -> None:
    """Of 0.6 m, which sound crosses and comes back in 0.9 ms."""
    long, part = 0.6, real_part(1)
    part = part._replace(line_length=long, line_volume=part.line_volume + part.line_area * (long - 0.15))
    line = SMALL_SAC.line.model_copy(update={"length": long, "volume": part.line_volume})
    plant = LINES[Variant.PLAIN]._replace(elements=24)
    model = calibrated_to(plant, part, SMALL_SAC.model_copy(update={"line": line})).injector
    for period in (0.02, 0.06):
        starts = tuple(0.15 + period * np.arange(10))
        events = (Event(100e6, (Shot(0.0, 1.9e-3),), Faults()),) * len(starts)
        bench = Bench(part, Needle(), events, line=plant, around=Surroundings(starts=starts))
        run = observed(bench, bench_at(bench.sample_rate).with_parameters(model))[3:]
        assert all(run.valid + run.inside)


def test_friction_at_the_wall_is_found_and_with_it_the_level() -> None:
    """It adds inertance: without it the nozzle came out 3.6 % too large."""
    injector = calibrated_to(LINES[Variant.FRICTION]).injector
    assert injector.line.inlet_loss_factor is None
    assert injector.line.wall_viscosity == pytest.approx(LINES[Variant.FRICTION].viscosity, rel=0.1)
    nozzle = injector.nozzle.flow_coefficient * injector.nozzle.area
    assert nozzle == pytest.approx(real_part(1).nozzle_area, rel=0.005)


def test_a_hole_that_shuts_is_learned_on_a_fitted_line() -> None:
    """Its step is narrower than the neurons: they leave of it what a fitted model leaves of a healthy injector."""
    done, (laws, faults) = calibrated_to(LINES[Variant.PLAIN]), NINE_LAWS["a hole shuts at a large drop"]
    events = in_turn(18, lambda _: faults, (60e6, 100e6, 140e6), (0.7e-3,) * 3 + (1.6e-3,) * 3)
    bench = Bench(real_part(1), Needle(), events, seed=95, line=LINES[Variant.PLAIN], laws=laws)
    model = done.injector.model_copy(update={"baseline": baseline_of(done, {})})
    run = observed(bench, bench_at(bench.sample_rate).with_parameters(model))
    assert all(run.valid[5:])
    assert np.abs(run.errors[5:]).max() < 0.02
    assert np.mean(run.inside) >= 0.9


def test_a_lump_that_cannot_be_stepped_is_left_out_with_the_reason(travelling: CalibrationResult) -> None:
    failed = [one for one in travelling.choice.tried if isinstance(one, FailedStructure)]
    assert [(one.structure.line, "steps a sample" in one.reason) for one in failed] == [("lump", True)] * 2


@pytest.mark.parametrize("stiffness", [0.8e9, 1.2e9, 1.6e9, 2.0e9, 2.6e9])
@pytest.mark.parametrize("structure", [one for one in STRUCTURES if one.line != "lump"], ids=lambda one: one.name)
def test_cells_are_as_many_as_sound_allows(structure: Structure, stiffness: float) -> None:
    line = coefficients(structure.of(with_values(NOMINAL, (STIFFNESS,), np.array([stiffness])))).line
    assert line.strain(STEP) < 0.95
    assert 0.6 < line.crossing * STEP < 1.0


def test_a_structure_keeps_the_numbers_of_the_file() -> None:
    for structure in STRUCTURES:
        formed = structure.of(NOMINAL)
        assert formed.line_outflow is structure.outflow
        assert formed.line.model == structure.line
        stated = [one for one in structure.free if one.stated(NOMINAL) is not None]
        assert values_of(formed, stated).tolist() == values_of(NOMINAL, stated).tolist()
