"""Runs of `discover` side by side."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.foundation.errors import UserError
from observer_rt.identification.discovery.runs import DiscoveryRun, as_json, change_lines, changes, run_table
from tests.identification.discovery.conftest import WEAR, Worn


@pytest.fixture
def document(worn: Worn) -> dict[str, Any]:
    parsed: dict[str, Any] = json.loads(json.dumps(worn.findings.as_json()))
    return parsed


def _run(folder: Path, name: str, document: dict[str, Any]) -> DiscoveryRun:
    (folder / name).mkdir()
    (folder / name / "findings.json").write_text(json.dumps(document))
    return DiscoveryRun.read(folder / name)


def _worn_by(document: dict[str, Any], more: float) -> dict[str, Any]:
    copy: dict[str, Any] = json.loads(json.dumps(document))
    size = copy["effects"][0]["parameters"]["v_H"]
    size["value"] += more
    size["ci95"] = [bound + more for bound in size["ci95"]]
    return copy


@pytest.mark.parametrize(("more", "significant"), [(0.1, True), (0.0, False)])
def test_wear_that_grew_is_told_with_its_interval(
    document: dict[str, Any], tmp_path: Path, more: float, significant: bool
) -> None:
    runs = [_run(tmp_path, "spring", document), _run(tmp_path, "autumn", _worn_by(document, more))]
    (change,) = changes(*runs)
    low, high = document["effects"][0]["parameters"]["v_H"]["ci95"]
    assert change.change == pytest.approx(more)
    assert change.half == pytest.approx(2**0.5 * (high - low) / 2, rel=0.01)
    assert change.is_significant is significant
    assert ("no change that shows" in change_lines(runs)[0]) is not significant
    compared = as_json(runs)
    assert [run["run"] for run in compared["runs"]] == [str(tmp_path / name) for name in ("spring", "autumn")]
    assert compared["runs"][0]["effects"][0]["parameters"]["v_H"]["value"] == pytest.approx(WEAR, abs=0.01)


def test_a_proposal_stands_beside_those_of_other_runs(document: dict[str, Any], tmp_path: Path) -> None:
    unknown = document | {
        "effects": [],
        "unknown": {
            **{"equation": "input", "phase": "open", "depends_on": [], "term": ""},
            "proposals": [{"sentence": "as if it hummed", "number": 1}],
        },
    }
    runs = [_run(tmp_path, "first", document), _run(tmp_path, "second", unknown)]

    assert [run.document.proposal for run in runs] == ["", "as if it hummed"]
    assert "as if it hummed" in [
        cell for column in run_table(runs).columns for cell in map(str, column.cells)
    ]


def test_sizes_in_different_models_are_not_subtracted(document: dict[str, Any], tmp_path: Path) -> None:
    other = _worn_by(document, 0.1)
    other["model"] = {"file": "amended.toml", "sha256": "1" * 64, "in_force": ["orifice_area"]}
    runs = [_run(tmp_path, "spring", document), _run(tmp_path, "autumn", other)]
    assert changes(*runs) == ()
    assert "different models" in change_lines(runs)[0]
    assert "orifice_area" in change_lines(runs)[0]


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [("schema", 2, "schema"), ("effects", None, "effects"), ("model", {"file": "x"}, "model.sha256")],
)
def test_another_document_is_refused_by_its_key(
    document: dict[str, Any], tmp_path: Path, key: str, value: object, said: str
) -> None:
    with pytest.raises(UserError, match=rf"findings\.json: is no findings of a run: {said}"):
        _run(tmp_path, "run", {**document, key: value})


@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.text(),
        lambda inner: st.lists(inner) | st.dictionaries(st.sampled_from(("schema", "effects", "gap")), inner),
    )
)
def test_no_document_is_more_than_refused(tmp_path_factory: pytest.TempPathFactory, content: object) -> None:
    path = tmp_path_factory.mktemp("run") / "findings.json"
    path.write_text(json.dumps(content))
    with pytest.raises(UserError, match="is no findings of a run"):
        DiscoveryRun.read(path)
