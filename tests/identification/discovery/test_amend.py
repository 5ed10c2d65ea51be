"""The amended injector file: everything kept, effects added, loaded by every command."""

import tomllib
from datetime import date
from pathlib import Path

import tomlkit
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.config.injector_file import InjectorFile, tables_in_force
from observer_rt.identification.discovery.amend import amended_effects, stable_cells, write_amended
from observer_rt.identification.discovery.search.verdict import name_effects
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.baseline import HealthyRemainder, HealthyShape, PhaseFigures, Remainder
from observer_rt.model.effects import effective_model, sized
from observer_rt.model.parameters import EffectInForce, EffectValue
from tests.identification.discovery.conftest import WEAR, Worn
from tests.identification.discovery.hidden import NOMINAL, recordings

WORN = EffectInForce(id="orifice_area", parameters={"v_H": EffectValue(value=0.1, ci95=(0.09, 0.11), unit="-")})
LEAK = EffectInForce(
    id="guide_leakage", parameters={"c": EffectValue(value=1.5e-14, unit="m3/(s Pa)")}, origin="workshop"
)


def test_every_line_of_the_file_is_kept(tmp_path: Path) -> None:
    given_text = NOMINAL_INJECTOR.read_text(encoding="utf-8")
    amended = tmp_path / "amended.toml"
    write_amended(amended, InjectorFile.read(NOMINAL_INJECTOR), [WORN])
    assert amended.read_text(encoding="utf-8").startswith(given_text)
    loaded = load_injector(amended)
    assert loaded.effects == (WORN,)
    assert loaded.model_copy(update={"effects": ()}) == load_injector()


def test_what_is_left_of_terms_accepted_in_part_is_stated_until_the_file_is_amended_again(tmp_path: Path) -> None:
    shape = HealthyShape(opening=(0.1, 0.2, 0.3), opening_slope=(0.0,), closing=(0.0,), closing_slope=(0.0,))
    variance, colour = PhaseFigures(open=1.5), PhaseFigures(open=2.0)
    observer = HealthyRemainder(variance=variance, colour=colour, overdispersion=1.2, shape=shape)
    left = Remainder(
        line_pressure_MPa=0.2, mass_share=0.003, sample_rate_Hz=1e5, variance=variance, observer=observer
    )
    path = tmp_path / "injector.toml"
    write_amended(path, InjectorFile.read(NOMINAL_INJECTOR), [WORN], remainder=left)
    assert load_injector(path).remainder == left
    write_amended(path, InjectorFile.read(path), [WORN])
    assert load_injector(path).remainder is None


def test_effects_in_force_are_replaced_and_comments_stay(tmp_path: Path) -> None:
    path = tmp_path / "injector.toml"
    write_amended(path, InjectorFile.read(NOMINAL_INJECTOR), [WORN, LEAK])
    tables = '[[effects]]\nid = "seat_area"\n[effects.parameters.v_S]\nvalue = 0.1\nunit = "-"\n'
    path.write_text(path.read_text(encoding="utf-8") + tables, encoding="utf-8")
    assert len(load_injector(path).effects) == 3
    write_amended(path, InjectorFile.read(path), [LEAK])
    text = path.read_text(encoding="utf-8")
    assert tomllib.loads(text)["effects"] == [
        {"id": "guide_leakage", "parameters": {"c": {"value": 1.5e-14, "unit": "m3/(s Pa)"}}, "origin": "workshop"}
    ]
    assert "# A_S(x_N) = pi * x_N" in text


def test_effects_written_otherwise_are_replaced_too(tmp_path: Path) -> None:
    path = tmp_path / "inline.toml"
    path.write_text('effects = [{ id = "seat_outflow" }]\n' + NOMINAL_INJECTOR.read_text(), encoding="utf-8")
    assert load_injector(path).effects
    write_amended(path, InjectorFile.read(path), [WORN])
    assert load_injector(path).effects == (WORN,)


@given(origin=st.text(), evidence=st.text(), value=st.floats(allow_nan=False, allow_infinity=False, width=64))
def test_any_text_and_number_comes_back(origin: str, evidence: str, value: float) -> None:
    effect = EffectInForce(
        id="fuel_density",
        parameters={"r": EffectValue(value=value, ci95=(value, value), unit="-")},
        origin=origin.encode(errors="ignore").decode(),
        evidence=evidence.encode(errors="ignore").decode(),
    )
    (read,) = tomllib.loads(tomlkit.dumps({"effects": tables_in_force([effect])}))["effects"]
    assert EffectInForce.model_validate(read) == effect


def test_what_was_found_is_written_with_its_evidence(worn: Worn) -> None:
    (effect,) = worn.findings.in_force
    assert effect.id == "orifice_area"
    value = effect.parameters["v_H"]
    assert value.ci95 is not None
    assert value.ci95[0] < WEAR < value.ci95[1]
    for name, digest in worn.task.hashes.items():
        assert f"{name} sha256 {digest[:12]}" in effect.evidence
    assert "named" in effect.evidence
    assert date.fromisoformat(effect.date)


def test_an_effect_found_on_top_of_one_in_force_becomes_one_total() -> None:
    before = NOMINAL.model_copy(update={"effects": (LEAK, WORN)})
    hidden = (sized("guide_leakage", c=1.5e-14), sized("orifice_area", v_H=0.3))
    measured = measurements(recordings(hidden))
    discovery = name_effects(effective_model(before), measured, workers=2)
    assert [effect.id for effect in discovery.effects] == ["orifice_area"]
    kept, total = amended_effects(before, discovery, measured, {})
    assert kept == LEAK
    assert total.parameters["v_H"].ci95 is not None
    low, high = total.parameters["v_H"].ci95
    assert low - 0.5 * (high - low) < 0.3 < high + 0.5 * (high - low)
    again = effective_model(NOMINAL.model_copy(update={"effects": (kept, total)}))
    assert name_effects(again, measured, workers=2).effects == ()


def test_a_line_whose_waves_get_faster_states_fewer_cells(tmp_path: Path) -> None:
    """So that the amended file runs as it is: `run` would refuse cells that sound crosses in less than a step."""
    path = tmp_path / "wave.toml"
    text = NOMINAL_INJECTOR.read_text(encoding="utf-8")
    path.write_text(text.replace('# model = "lump"  ', 'model = "wave"  '), encoding="utf-8")
    wave, measured = load_injector(path), measurements(recordings(points=((100e6, 1e-3),)))
    stiffer = EffectInForce(id="bulk_modulus", parameters={"r": EffectValue(value=0.5, unit="-")})
    cells = stable_cells(wave, [stiffer], measured)
    assert cells is not None
    assert wave.line.cells is not None
    assert cells < wave.line.cells
    assert stable_cells(wave, [WORN], measured) is None
    amended = tmp_path / "amended.toml"
    write_amended(amended, InjectorFile.read(path), [stiffer], cells)
    loaded = load_injector(amended)
    assert loaded.line.cells == cells
    assert effective_model(loaded).coefficients.line.strain(1e-5) < 1.0
    assert loaded.effects == (stiffer,)
