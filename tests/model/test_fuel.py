"""Density and bulk moduli of fuel at another temperature, under pressure, and of a fuel by its name."""

from pathlib import Path

import pytest

from observer_rt.config.bench import FUELS, NOMINAL_INJECTOR, load_injector
from observer_rt.config.toml_file import read_toml
from observer_rt.foundation.errors import UserError
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.surroundings import at_temperature
from tests.model.conftest import filled

NOMINAL = load_injector()
REFERENCE = 313.15  # K, of the nominal file


def with_fluid(**changes: float | None) -> InjectorParameters:
    return NOMINAL.model_copy(update={"fluid": NOMINAL.fluid.model_copy(update=changes)})


def test_nothing_changes_at_the_reference_temperature() -> None:
    assert at_temperature(NOMINAL, REFERENCE) == NOMINAL


def test_both_fall_linearly() -> None:
    """40 K warmer: 830 kg/m3 less 2.8 %, 1.6 GPa less 0.28 GPa; nothing else moves."""
    fluid = at_temperature(NOMINAL, REFERENCE + 40.0).fluid
    assert fluid.density_line == fluid.density_nozzle == pytest.approx(806.76)
    assert fluid.bulk_modulus_line == fluid.bulk_modulus_sac == pytest.approx(1.32e9)
    assert at_temperature(NOMINAL, REFERENCE + 40.0).model_copy(update={"fluid": NOMINAL.fluid}) == NOMINAL


def test_the_fuel_of_the_sac_may_be_another_than_that_of_the_line() -> None:
    fluid = at_temperature(with_fluid(bulk_modulus_sac=1.2e9, density_nozzle=800.0), REFERENCE - 20.0).fluid
    assert fluid.bulk_modulus_sac == pytest.approx(1.34e9)
    assert fluid.density_nozzle == pytest.approx(811.2)


def test_without_a_reference_it_is_refused() -> None:
    with pytest.raises(UserError, match=r"(?s)fluid\.reference_temperature: .*remedy: .*313\.15"):
        at_temperature(with_fluid(reference_temperature=None), 300.0)


@pytest.mark.parametrize(
    ("changes", "cause"),
    [({"bulk_modulus_slope": -2e7}, "bulk_modulus_slope"), ({"thermal_expansion": 9e-3}, "thermal_expansion")],
)
def test_a_law_that_leaves_no_fuel_is_refused(changes: dict[str, float], cause: str) -> None:
    with pytest.raises(UserError, match=cause):
        at_temperature(with_fluid(**changes), 423.15)


@pytest.mark.parametrize("name", read_toml(FUELS))
def test_a_fuel_stiffens_by_half_and_grows_denser_by_4_percent_from_60_to_150_mpa(name: str) -> None:
    fuel = filled(NOMINAL, name).fluid.in_line
    stiffer, denser = (1.65, 1.049) if name == "gasoline" else (1.475, 1.0375)  # which is softer to begin with
    assert fuel.stiffness(150e6) / fuel.stiffness(60e6) == pytest.approx(stiffer, abs=0.075)
    assert fuel.density(150e6) / fuel.density(60e6) == pytest.approx(denser, abs=0.004)


def of_file(tmp_path: Path, fluid: str) -> InjectorParameters:
    text, path = NOMINAL_INJECTOR.read_text(), tmp_path / "injector.toml"
    path.write_text(f"{text.partition('[fluid]')[0]}[fluid]\n{fluid}\n[line]{text.partition('[line]')[2]}")
    return load_injector(path)


def test_a_file_names_its_fuel_and_overrides_what_it_knows_better(tmp_path: Path) -> None:
    warm = of_file(tmp_path, 'fuel = "en590"\nreference_temperature = 343.15\ndensity_nozzle = 780.0')
    assert warm.fluid.density_nozzle == 780.0
    assert warm.fluid.density_line == pytest.approx(817.0 * (1 - 30 * 8.3e-4))
    assert warm.fluid.bulk_modulus_line == pytest.approx(1.46e9 - 30 * 8e6)


def test_what_is_no_fuel_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"(?s)injector\.toml: fluid\.fuel: .*did you mean 'en590'"):
        of_file(tmp_path, 'fuel = "en591"')
