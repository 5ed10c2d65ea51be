"""The number of integration steps: the rate it rests on bounds the truth, and the integration stays stable."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.config.bench import EXAMPLE_BENCH, Bench, load_bench, load_injector
from observer_rt.config.injector_sections import SamplingConfig
from observer_rt.core.model.model import rates_of_change
from observer_rt.engine.service.injector import bench_constants
from observer_rt.foundation.errors import UserError
from observer_rt.model.effective import coefficients
from observer_rt.model.effects import effective_model, sized
from observer_rt.model.hydraulics import full_lift_area
from observer_rt.model.network import constant_network
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.stability import fastest_rate, in_stable_cells, substeps_needed
from tests.differences import differences
from tests.model.conftest import integrate, with_line

PRESSURE = st.one_of(st.floats(-0.01, 0.05), st.floats(-0.1, 2.5))


@given(x1=PRESSURE, x2=st.floats(-1.5, 1.5), x3=PRESSURE, opened=st.floats(0.0, 1.0), sac=st.floats(0.01, 10))
@example(x1=0.0, x2=0.0, x3=0.0, opened=1.0, sac=1.0)
def test_fastest_rate_bounds_every_mode(
    injector: InjectorParameters, x1: float, x2: float, x3: float, opened: float, sac: float
) -> None:
    """Eigenvalues of the equations, linearised numerically, for sacs from a hundredth to ten times nominal."""
    volume = injector.nozzle.sac_volume * sac
    injector = injector.model_copy(update={"nozzle": injector.nozzle.model_copy(update={"sac_volume": volume})})
    c = coefficients(injector)
    u = (0.95, opened * full_lift_area(injector) / c.area_scale)

    def rates(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array(rates_of_change((x[0], x[1], x[2]), u, c, constant_network()))

    modes = np.linalg.eigvals(differences(rates, np.array([x1, x2, x3]), 1e-6))
    assert np.abs(modes).max() <= fastest_rate(injector, c) * (1 + 1e-6)


@pytest.mark.parametrize(
    ("rail_pressure", "wear"),
    [
        *((pressure, 0.0) for pressure in (5.2e6, 6e6, 10e6, 40e6, 100e6, 200e6)),
        *((pressure, 0.5) for pressure in (20e6, 40e6, 200e6)),  # no injector opens below
    ],
)
@pytest.mark.parametrize("sample_rate", [20e3, 100e3])
def test_integration_stays_stable_at_any_pressure(
    injector: InjectorParameters, rail_pressure: float, sample_rate: float, wear: float
) -> None:
    """Against ten times finer steps over a stroke: within 1 % of the rail's pressure difference."""
    c = coefficients(injector)
    rail = (rail_pressure - c.chamber_pressure) / c.pressure_scale
    time = np.arange(round(6e-3 * sample_rate)) / sample_rate
    full = full_lift_area(injector) / c.area_scale
    area = np.interp(time, [0.5e-3, 0.9e-3, 3.0e-3, 3.3e-3], [0.0, full, full, 0.0])
    inputs = np.column_stack([np.full(time.size, rail), area])
    substeps = substeps_needed(injector, sample_rate)
    network = constant_network(wear, wear)
    states = integrate(inputs, (rail, 0.0, 0.0), 1 / sample_rate, substeps, c, network)
    finer = integrate(inputs, (rail, 0.0, 0.0), 1 / sample_rate, 10 * substeps, c, network)
    assert np.isfinite(states).all()
    assert np.abs(states - finer)[:, [0, 2]].max() < 0.01 * rail


def test_steps_are_the_stable_ones(injector: InjectorParameters) -> None:
    """RK4 is stable to 2.785 time constants: not exceeded, and not wasted by more than a step and a reserve."""
    fastest = fastest_rate(injector, coefficients(injector))
    for sample_rate in (6e3, 20e3, 50e3, 100e3, 1e6):
        steps = substeps_needed(injector, sample_rate)
        assert fastest / (sample_rate * steps) < 2.785
        assert steps == 1 or fastest / (sample_rate * (steps - 1)) > 2.5


@pytest.mark.parametrize("line", ["wave", "lump"])
@pytest.mark.parametrize(("stated", "r", "left"), [(4, 0.0, 4), (64, 0.0, 11), (20, 3.0, 6), (4, 10.0, None)])
def test_a_line_has_as_many_of_its_cells_as_are_stable(line: str, stated: int, r: float, left: int | None) -> None:
    model = effective_model(with_line(load_injector(), model=line, cells=stated), (sized("bulk_modulus", r=r),))
    left = left if line == "wave" else stated
    stable = in_stable_cells(model, 1e-5, 100e6)
    assert (stable and stable.injector.line.cells, stable is model) == (left, left == stated)


def _bench_at(sample_rate: float) -> Bench:
    return load_bench(EXAMPLE_BENCH).with_sections(sampling=SamplingConfig(rate_hz=sample_rate))


@pytest.mark.parametrize("sample_rate", [1e3, 2500.0, 5123.4])
def test_too_slow_a_sample_rate_is_refused_with_one_that_works(sample_rate: float) -> None:
    with pytest.raises(UserError, match="integration steps a sample") as refusal:
        bench_constants(_bench_at(sample_rate).injector)
    assert "sampling.rate_hz" in refusal.value.location
    enough = float(refusal.value.remedy.split("sample at ")[1].split(" Hz")[0])
    assert enough > sample_rate
    assert bench_constants(_bench_at(enough).injector).interval == pytest.approx(1 / enough)


def test_sac_too_small_for_explicit_steps_is_refused() -> None:
    bench = _bench_at(100e3)
    nozzle = bench.injector.parameters.nozzle.model_copy(update={"sac_volume": 0.5e-9})
    tiny = bench.injector.parameters.model_copy(update={"nozzle": nozzle})
    with pytest.raises(UserError, match="relaxes at up to"):
        bench_constants(bench.with_parameters(tiny).injector)
