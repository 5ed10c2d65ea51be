"""A fit finds what the file has wrong, chooses the plant's structure, and says what its level rests on."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lsim

from observer_rt.desk.simulation.simulate import SimulatedNoise, Simulation
from observer_rt.files.signals.recording import Recording, shown_slowly
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.identification.fit.calibrate import RATE_MISFIT, CalibrationResult, LevelSource, calibrate
from observer_rt.identification.fit.document import level_words, verdict_words
from observer_rt.identification.fit.forms import (
    INERTANCE,
    STIFFENING,
    STIFFNESS,
    FreeParameter,
    Structure,
    with_values,
)
from observer_rt.identification.fit.masses import MEAN, WeighedMass
from observer_rt.identification.fit.problem import Calibration, certainty, folds_of
from observer_rt.identification.likelihood.bounded_fit import Quadratic, linearise
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.identification.likelihood.open_loop import mass, simulated
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import EffectInForce, EffectValue, InjectorParameters, LineOutflow
from tests.identification.fit.healthy import (
    LUMPS,
    NOMINAL,
    POINTS,
    of_independent_plant,
    off_by_ten_percent,
    simulations,
)
from tests.model.conftest import filled
from tests.plants.parameters import Injector

UNSEEN = simulations([(80e6, 1.2e-3)], seed=9)
THE_PLANTS = LUMPS[:1]  # structure, where its choice is not what is tested


def _measured(made: Sequence[Simulation]) -> tuple[Measurement, ...]:
    return measurements([one.recording for one in made])


def _fit(
    measured: Sequence[Measurement],
    file: InjectorParameters,
    among: Sequence[Structure] = LUMPS,
    **weighed: WeighedMass,
) -> CalibrationResult:
    by_number = {int(name[1:]): {MEAN: one} for name, one in weighed.items()}
    return calibrate(file, measured, by_number, lambda _: None, among)


def _deviations(done: CalibrationResult, true: InjectorParameters) -> dict[str, float]:
    """On the parameters' scales, in standard deviations."""
    free, sigmas = done.fitted.calibration.free, done.fitted.certainty.sigmas
    return {
        one.symbol: float((one.theta_of(one.of(done.injector)) - one.theta_of(one.of(true))) / sigma)
        for one, sigma in zip(free, sigmas, strict=True)
    }


def _mass_error(injector: InjectorParameters) -> float:
    (measured,), (simulation,) = _measured(UNSEEN), UNSEEN
    density = injector.fluid.density_nozzle
    modelled = sum(mass(measured, one, density) for one in simulated(measured, effective_model(injector)))
    rate = simulation.truth.injection_rate
    runs = simulated(measured, effective_model(NOMINAL))
    true = sum(mass(measured, replace(one, rate=rate[one.rate_samples]), density) for one in runs)
    return modelled / true - 1.0


@pytest.fixture(scope="module")
def by_pressures() -> CalibrationResult:
    return _fit(_measured(simulations()), off_by_ten_percent())


def test_parameters_are_found_within_their_intervals(by_pressures: CalibrationResult) -> None:
    deviations = _deviations(by_pressures, NOMINAL)
    assert deviations.keys() == {"K_L", "xi", "alpha_S", "alpha_H", "V_S"}
    assert max(map(abs, deviations.values())) < 3.0
    assert max(by_pressures.fitted.certainty.sigmas) < 0.01


def test_the_structure_of_the_plant_is_chosen_and_the_model_adequate(by_pressures: CalibrationResult) -> None:
    assert by_pressures.fitted.structure.outflow is LineOutflow.NOZZLE
    assert [one.structure.outflow for one in by_pressures.choice.as_good] == [LineOutflow.NOZZLE]
    assert by_pressures.inadequate == ()
    assert verdict_words(by_pressures).startswith("adequate")
    for residual in by_pressures.comparison.residuals:
        assert (residual.chi2["file"] or 0.0) > 5.0 > 1.5 > (residual.chi2["fitted"] or np.inf)


def test_mass_is_right_where_nothing_was_fitted(by_pressures: CalibrationResult) -> None:
    assert abs(_mass_error(off_by_ten_percent())) > 0.03
    assert abs(_mass_error(by_pressures.injector)) < 0.003
    assert 0.001 <= by_pressures.mass_share < 0.003


def test_an_injection_tells_its_mass_better_the_more_the_line_shows(by_pressures: CalibrationResult) -> None:
    """1.1 ms at 100 MPa tell .29 % by an information limit that was computed elsewhere, with other terms known."""
    shares = dict(zip(POINTS, by_pressures.shares_by_pressures, strict=True))
    assert shares[100e6, 1.9e-3] == pytest.approx(0.0029, rel=0.2)
    most, least = (which(shares, key=lambda point: shares[point]) for which in (max, min))
    assert (most[0], least[0]) == (60e6, 140e6)
    quiet = simulations(POINTS[2:3], noise=SimulatedNoise(rail_pressure=0.01e6, line_pressure=0.015e6))
    alone = calibrate(NOMINAL, _measured(quiet), {}, lambda _: None, LUMPS[:1])
    assert alone.shares_by_pressures[0] == pytest.approx(0.1 * shares[POINTS[2]], rel=0.5)


def test_the_level_rests_on_the_inertance_of_the_file(by_pressures: CalibrationResult) -> None:
    assert by_pressures.level_source is LevelSource.FILE
    assert "one to one on A_L/(rho_L L_L)" in level_words(by_pressures)


@pytest.mark.slow
def test_flows_coefficients_and_sac_scale_with_the_inertance(by_pressures: CalibrationResult) -> None:
    """The exact invariance: no pressure tells the scale."""
    share = 1.05
    file = off_by_ten_percent()
    wrong = file.model_copy(
        update={"line": file.line.model_copy(update={"diameter": file.line.diameter * np.sqrt(share)})}
    )
    scaled = _fit(_measured(simulations()), wrong)
    assert scaled.comparison.unexplained.mean == pytest.approx(by_pressures.comparison.unexplained.mean, rel=0.01)
    right, moved = by_pressures.injector, scaled.injector
    for section, key, power in (
        ("nozzle", "flow_coefficient", 1),
        ("seat", "flow_coefficient", 1),
        ("nozzle", "sac_volume", 1),
        ("fluid", "bulk_modulus_line", -1),
    ):
        ratio = getattr(getattr(moved, section), key) / getattr(getattr(right, section), key)
        assert ratio == pytest.approx(share**power, rel=0.002), key
    assert _mass_error(moved) == pytest.approx(share - 1.0, abs=0.003)


def test_how_a_fuel_stiffens_is_fitted() -> None:
    file = filled(NOMINAL, "en590")
    plant = with_values(file, (STIFFNESS, STIFFENING), np.array([1.35e9, 12.0]))
    fluid = _fit(_measured(simulations(POINTS[1::2], injector=plant)), file, THE_PLANTS).injector.fluid
    assert fluid.bulk_modulus_by_pressure == pytest.approx(12.0, abs=0.2)
    assert fluid.bulk_modulus_line == pytest.approx(1.35e9, rel=0.01)


def _linearised(*further: FreeParameter) -> tuple[Calibration, Quadratic]:
    """Two recordings at the true numbers, with further parameters free."""
    calibration = Calibration(NOMINAL, (*LUMPS[0].free, *further), folds_of(_measured(simulations()[:2]), {}))
    here = calibration.residuals(calibration.centre)
    assert here is not None
    return calibration, linearise(calibration.residuals, calibration.centre, here, calibration.ranges)


def test_without_a_rate_the_inertance_is_seen_not_to_be_told() -> None:
    assert certainty(*_linearised(INERTANCE), 1.0).undetermined is not None


def test_offsets_that_are_not_known_make_parameters_less_sure() -> None:
    """As the inverse of the whole information says; with the offsets known, xi would be surer."""
    calibration, at = _linearised()
    data, p = at.information - np.diag(calibration.prior_sigmas**-2), len(calibration.free)
    sigmas = certainty(calibration, at, 1.0).sigmas
    np.testing.assert_allclose(sigmas, np.sqrt(np.diag(np.linalg.inv(data)))[:p], rtol=1e-3)
    assert np.any(sigmas > 1.03 * np.sqrt(np.diag(np.linalg.inv(data[:p, :p]))))
    np.testing.assert_allclose(certainty(calibration, at, 4.0).sigmas, 2.0 * sigmas)


def test_what_is_faster_than_the_cells_carry_is_averaged() -> None:
    """Every five innovations of 10 us are one, normalised again; a measured rate stays as it is."""
    (fold,) = folds_of(_measured(simulations([POINTS[0]], measured_rate=True, injections=1)), {})
    calibration = Calibration(NOMINAL, LUMPS[0].free, [replace(fold, rate_shape=True)])
    here, judged = calibration.residuals(calibration.centre), calibration.judge(calibration.centre, 0)
    assert here is not None
    assert judged is not None
    blocks = judged.z.size // 5
    assert here.counts.tolist()[:2] == [blocks, judged.rate_z.size]
    np.testing.assert_allclose(here.z[1], np.sum(judged.z[5:10]) / np.sqrt(5.0))
    np.testing.assert_array_equal(here.z[blocks : blocks + judged.rate_z.size], judged.rate_z)


def _wrong_inertance() -> InjectorParameters:
    file = off_by_ten_percent()
    return with_values(file, (INERTANCE,), np.array([NOMINAL.line.diameter * np.sqrt(1.05)]))


def test_a_measured_rate_fixes_the_level_of_a_wrong_inertance() -> None:
    done = _fit(_measured(simulations(POINTS[::2], measured_rate=True)), _wrong_inertance(), THE_PLANTS)
    assert done.level_source is LevelSource.RATE
    assert done.fitted.calibration.folds[0].rate_shape
    assert "contradicts" not in verdict_words(done)
    assert abs(_mass_error(done.injector)) < 0.005  # the rate's gain errors are 0.5 % a recording
    assert abs(_deviations(done, NOMINAL)["d_L"]) < 3.0


def _by_a_meter(recording: Recording, *lags: float) -> Recording:
    """Its rate by a meter of some poles; of none, that overshoots by 12 % and creeps: the last tenth within .2 ms."""
    rate, time = recording.signals["injection_rate"], recording.time
    if lags:
        return replace(recording, injection_rate=shown_slowly(rate, float(time[1]), *lags))
    damping, frequency, creep = 0.56, 2.0 * np.pi * 3e3, 0.2e-3
    quick = lsim(([frequency**2], [1.0, 2.0 * damping * frequency, frequency**2]), rate, time)[1]
    return replace(recording, injection_rate=0.9 * quick + 0.1 * lsim(([1.0], [creep, 1.0]), quick, time)[1])


@pytest.mark.decisive(1)
@pytest.mark.parametrize(("lags", "mean"), [((), 79e-6), ((0.2e-3,), 200e-6), ((0.25e-3, 0.08e-3), 330e-6)])
def test_a_rate_of_a_meter_with_dynamics_gives_the_level_by_its_integral(lags: Sequence[float], mean: float) -> None:
    """Its shape would make sac and seat others, or the needle late; by how much it is late in the mean is found."""
    made = [_by_a_meter(one.recording, *lags) for one in simulations(POINTS[::2], measured_rate=True)]
    done = _fit(measurements(made), _wrong_inertance(), THE_PLANTS)
    assert done.inadequate == ()
    assert abs(_mass_error(done.injector)) < 0.01
    assert max(map(abs, _deviations(done, NOMINAL).values())) < 4.0
    assert done.rate_misfit < RATE_MISFIT
    assert sum(done.meter) == pytest.approx(mean, rel=0.05)
    assert f"rate_meter_ms of a bench file: [{1e3 * done.meter[0]:.3g}" in verdict_words(done)


@pytest.mark.slow
def test_one_measured_mass_fixes_the_level_of_a_wrong_inertance() -> None:
    made = simulations()
    true = MILLIGRAM * float(_fit(_measured(made), NOMINAL).comparison.masses(1.0)[0].mass_mg["fitted"] or 0.0)
    done = _fit(_measured(made), _wrong_inertance(), n0=WeighedMass(true, 0.003 * true))
    assert done.level_source is LevelSource.MASS
    assert abs(_mass_error(done.injector)) < 0.005


@pytest.mark.slow
@pytest.mark.parametrize("drained_by_seat", [0, 1])
def test_an_independent_plant_is_fitted_in_its_own_structure(drained_by_seat: int) -> None:
    done = _fit(measurements(of_independent_plant(Injector(drained_by_seat=drained_by_seat))), off_by_ten_percent())
    assert done.fitted.structure.outflow is (LineOutflow.SEAT if drained_by_seat else LineOutflow.NOZZLE)
    assert done.inadequate == ()
    assert max(map(abs, _deviations(done, NOMINAL).values())) < 4.0


def test_a_line_that_no_structure_has_is_inadequate_and_said_where() -> None:
    """Lumps fitted to a line in which pressure travels."""
    part = Injector(line_cells=12, line_damping=1.0)
    done = _fit(measurements(of_independent_plant(part, POINTS[::5])), NOMINAL)
    assert done.inadequate
    assert "Most is left in" in verdict_words(done)


def test_an_effect_in_force_is_part_of_the_model_that_is_fitted() -> None:
    offset = EffectInForce(id="guide_leakage", parameters={"c": EffectValue(value=3e-14, unit="m3/(s Pa)")})
    leaking = NOMINAL.model_copy(update={"effects": (offset,)})
    measured = _measured(simulations(POINTS[::2], injector=leaking))
    file = off_by_ten_percent(leaking)
    assert max(map(abs, _deviations(_fit(measured, file, THE_PLANTS), NOMINAL).values())) < 3.0
    blind = _fit(measured, file.model_copy(update={"effects": ()}), THE_PLANTS)
    assert max(map(abs, _deviations(blind, NOMINAL).values())) > 5.0


@pytest.mark.parametrize(("injections", "folds"), [(4, 2), (1, 1)])
def test_one_recording_is_judged_by_halves_one_injection_with_nothing_held_out(injections: int, folds: int) -> None:
    done = _fit(_measured(simulations([(100e6, 1.9e-3)], injections=injections)), off_by_ten_percent(), THE_PLANTS)
    assert len(done.fitted.calibration.folds) == folds
    assert (done.fitted.held_out is None) == ("of all there is" in done.choice.reason) == (folds == 1)
