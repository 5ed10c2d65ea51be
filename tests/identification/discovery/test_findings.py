"""findings.json: complete, in the units it states, readable by any JSON reader."""

import json
from typing import Any

import pytest

from tests.identification.discovery.conftest import WEAR, Worn


@pytest.fixture
def document(worn: Worn) -> dict[str, Any]:
    """The document as a reader without NaN sees it."""
    text = json.dumps(worn.findings.as_json(), allow_nan=False)
    parsed: dict[str, Any] = json.loads(text)
    return parsed


def test_the_contract_is_kept(document: dict[str, Any]) -> None:
    assert (document["schema"], document["verdict"]) == (1, "named")
    assert {"confidence_method", "unknown", "decide_by", "fitted_on", "held_out", "seconds"} <= document.keys()
    assert set(document["detection"]) == {"gain", "threshold"}
    assert document["detection"]["gain"] > document["detection"]["threshold"]
    assert document["amended_model"] == "amended.toml"
    assert document["unknown"] is None
    (effect,) = document["effects"]
    assert {"id", "parameters", "confidence", "indistinguishable_from", "gap_share"} <= effect.keys()
    assert effect["id"] == "orifice_area"
    low, high = effect["parameters"]["v_H"]["ci95"]
    assert low < WEAR < high
    assert low < effect["parameters"]["v_H"]["value"] < high
    assert effect["parameters"]["v_H"]["unit"] == "-"
    assert 0.9 < effect["gap_share"] <= 1.0


def test_where_names_signal_phase_and_equation(document: dict[str, Any]) -> None:
    keys = {"signal", "phase", "equation", "rail_pressure_MPa", "nrmse", "significance"}
    for item in document["where"]:
        assert keys <= item.keys()
        assert item["signal"] in ("line_pressure", "injection_rate")
        assert item["phase"] in ("closed", "opening", "open", "closing", "after")
        assert item["equation"] in (None, "line_pressure")
        assert round(item["rail_pressure_MPa"]) in (60, 140)
    assert any(item["nrmse"] > 3.0 for item in document["where"])
    assert all(item["after"]["nrmse"] < 1.6 for item in document["where"])


def test_the_gap_is_in_printed_units(document: dict[str, Any]) -> None:
    gap = document["gap"]
    pressure = gap["line_pressure"]
    assert 0.1 < pressure["noise_floor_MPa"] < pressure["before_MPa"] < 5.0
    assert set(gap["injection_rate"]) == {"before_mm3_per_ms", "after_mm3_per_ms", "noise_floor_mm3_per_ms"}
    assert 1.0 < gap["injection_rate"]["before_mm3_per_ms"] < 20.0
    assert gap["injected_mass"]["measured"] is True
    assert 1.0 < gap["injected_mass"]["before_mg"] < 30.0


def test_the_ranking_holds_the_model_as_given(document: dict[str, Any]) -> None:
    by_ids = {tuple(item["ids"]): item for item in document["ranking"]}
    assert by_ids["orifice_area",]["held_out_chi2"] < by_ids[()]["held_out_chi2"] - 100.0
    assert all(item["n_effective"] > 1000 for item in by_ids.values())
    moved = by_ids["orifice_area",]["moves"]
    assert moved["injected_mass_mean_mg"] > 1.0
    assert by_ids[()]["moves"] == {"line_pressure_rms_MPa": 0.0, "injected_mass_mean_mg": 0.0}


def test_checks_are_in_it(document: dict[str, Any]) -> None:
    noise = [check for check in document["checks"] if check["id"] == "line_pressure_noise"]
    assert [check["recording"] for check in noise] == ["<0>.csv", "<1>.csv"]
    assert all(check["value"] == pytest.approx(0.15, rel=0.05) for check in noise)
    assert all(check["sigma"] is None for check in noise)
