"""The files behind the report: they say what findings.json says, and an earlier run leaves nothing behind."""

import csv
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pytest

from observer_rt.identification.discovery.report.data import remove_data, write_data
from tests.identification.discovery.conftest import Worn


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def data(worn: Worn, tmp_path: Path) -> Path:
    folder = tmp_path / "data"
    write_data(folder, worn.findings)
    return folder


def test_the_tables_say_what_the_document_says(worn: Worn, data: Path) -> None:
    document = worn.findings.as_json()
    for name, key in (("candidates", "ranking"), ("disagreement", "where"), ("standstill", "checks")):
        assert len(_rows(data / f"{name}.csv")) == len(document[key])
    candidates = _rows(data / "candidates.csv")
    assert [one["ids"] for one in candidates] == ["+".join(one["ids"]) for one in document["ranking"]]
    assert [float(one["chi2"]) for one in candidates] == pytest.approx(
        [one["chi2"] for one in document["ranking"]]
    )
    effect = _rows(data / "effects.csv")[0]
    size = document["effects"][0]["parameters"][effect["parameter"]]
    assert [float(effect[key]) for key in ("value", "ci95_low", "ci95_high")] == [
        size["value"],
        *size["ci95"],
    ]
    map_ = _rows(data / "disagreement.csv")
    assert [float(row["after_nrmse"]) for row in map_] == pytest.approx(
        [one["after"]["nrmse"] for one in document["where"]]
    )
    gaps = _rows(data / "gaps.csv")
    assert {(row["signal"], row["unit"]) for row in gaps} == {
        ("line_pressure", "MPa"),
        ("injection_rate", "mm3/ms"),
        ("injected_mass", "mg"),
    }
    assert {row["operating_point"] for row in gaps} == set(document["held_out"])
    residuals = _rows(data / "residuals.csv")
    assert [float(row["before_MPa"]) for row in residuals] == pytest.approx(
        [one["before_MPa"] for one in document["injections"]]
    )
    assert [float(row["change_pct"]) for row in _rows(data / "masses.csv")] == pytest.approx(
        [one["change_pct"] for one in document["masses"]]
    )


def test_signals_and_figures_of_the_injections_shown(worn: Worn, data: Path) -> None:
    for number, overlay in enumerate(worn.findings.overlays, start=1):
        rows = _rows(data / f"injection_{number}.csv")
        assert len(rows) == overlay.time.size
        assert float(rows[-1]["time_ms"]) == pytest.approx(overlay.time[-1] * 1e3)
        assert overlay.amended_pressure is not None
        assert float(rows[9]["line_pressure_amended_MPa"]) == pytest.approx(overlay.amended_pressure[9] / 1e6)
    for name in ("injections.svg", "gaps.svg"):
        assert ET.parse(data / name).getroot().tag == "{http://www.w3.org/2000/svg}svg"


def test_what_was_not_measured_has_no_column(worn: Worn, tmp_path: Path) -> None:
    overlays = tuple(replace(one, measured_rate=None) for one in worn.findings.overlays)
    findings = replace(worn.findings, overlays=overlays)
    write_data(tmp_path, findings)
    assert "injection_rate_mm3_per_ms" not in _rows(tmp_path / "injection_1.csv")[0]


def test_only_what_was_written_is_taken_away(data: Path) -> None:
    (data / "mine.csv").write_text("mine")
    remove_data(data)
    assert [path.name for path in data.iterdir()] == ["mine.csv"]
    (data / "mine.csv").unlink()
    remove_data(data)
    assert not data.exists()
