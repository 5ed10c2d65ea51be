"""JSON and MATLAB of an export: their numbers and equations are those of the model here."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from observer_rt.core.model.model import rate_of_injection, rates_of_change
from observer_rt.desk.export.document import document_of
from observer_rt.desk.export.matlab import COEFFICIENTS, RATES, matlab_files
from tests.desk.export.exported import Exported, exported, learned


class Struct:
    """A struct of MATLAB."""


def run_matlab(text: str, **given: Any) -> dict[str, Any]:
    """The assignments of a function of MATLAB in its plain subset, and what they assign; indices begin at 1."""
    names = dict(given) | {"c": given.get("c", Struct()), "double": float, "abs": abs}
    names |= {"tanh": np.tanh, "sqrt": np.sqrt, "max": max}
    for line in text.replace("...\n", "").splitlines()[1:]:
        code = line.partition("%")[0].strip().rstrip(";")
        if code in ("", "end"):
            continue
        target, _, value = code.partition(" = ")
        value = value.replace("^", "**").replace("~=", "!=").replace("&&", "and")
        value = re.sub(r"\b([xun])\((\d)\)", lambda m: f"{m[1]}[{int(m[2]) - 1}]", value)
        value = value.replace("c.W * ", "c.W @ ").replace("c.V * ", "c.V @ ")
        if value.startswith("["):
            separator = " " if not re.search(r"[a-z]", value.replace("e", "")) else None
            rows = [row.split(separator) if separator else [row] for row in value.strip("[]").split(";")]
            matrix = np.array([[eval(cell, names) for cell in row if cell] for row in rows], dtype=np.float64)
            result: Any = matrix[:, 0] if matrix.shape[1] == 1 else matrix
        elif value.startswith("{"):
            result = re.findall(r"'((?:[^']|'')*)'", value)
        else:
            result = eval(value, names)
        if target.startswith("c."):
            setattr(names["c"], target[2:], result)
        else:
            names[target] = result
    return names


@pytest.fixture(scope="module")
def effects(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return exported(tmp_path_factory.mktemp("model") / "injector.toml", "effects", learned())


def test_rates_of_matlab(effects: Exported) -> None:
    files = matlab_files(effects.frozen)
    c = run_matlab(files[COEFFICIENTS])["c"]
    it = effects.frozen
    model = it.constants.coefficients._replace(line=it.line)
    generator = np.random.default_rng(0)
    states = [(*generator.uniform(-0.02, 1.5, 3), *generator.uniform(0.0, 1.2, 2)) for _ in range(50)]
    states += [(0.6, 0.01, 0.0, 0.6, 0.0), (0.6, 0.01, 0.3, 0.6, 0.0), (0.003, 0.0, 0.0, 0.6, 0.5)]
    for state in states:
        x, u = np.array(state[:3]), np.array(state[3:])
        found = run_matlab(files[RATES], x=x, u=u, c=c)
        expected = rates_of_change(x, tuple(u), model, it.network)
        np.testing.assert_allclose(found["dx"], expected, rtol=1e-9, atol=1e-6)
        rate = 0.0 if u[1] <= 0.0 and x[2] == 0.0 else rate_of_injection(x, tuple(u), model, it.network)
        assert found["injection_rate"] == pytest.approx(rate, rel=1e-9, abs=1e-18)


def test_matlab_has_no_rates_for_what_they_would_not_hold(tmp_path: Path) -> None:
    for name in ("wave", "terms"):
        it = exported(tmp_path / "injector.toml", name)
        files = matlab_files(it.frozen)
        assert set(files) == {COEFFICIENTS}
        c = run_matlab(files[COEFFICIENTS])["c"]
        assert c.nozzle_flow == it.frozen.constants.coefficients.nozzle.flow
        assert c.a1 == it.frozen.line.a1
        assert ("lagged(needle_lift, 0.1)" in " ".join(c.equations)) == (name == "terms")


def test_document(tmp_path: Path, effects: Exported) -> None:
    document = json.loads(json.dumps(document_of(effects.frozen, effects.bench.injector.parameters)))
    numbers = {one["name"]: one["value"] for one in document["coefficients"]}
    it = effects.frozen
    assert numbers["critical_excess"] == 0.08
    assert numbers["sensor_lag"] == it.sensor.lag > 10e-6
    assert numbers["sensor_delay"] == pytest.approx(25e-6)
    assert numbers["lift_shift"] == pytest.approx(8e-6)
    assert all(one["unit"] and one["meaning"] for one in document["coefficients"])
    assert document["phi"]["bias"] == it.network.bias.tolist()
    assert document["parameters"]["effects"][0]["id"] == "lift_offset"
    assert document["phi_version"] == learned().phi_version > 0
    worn = exported(tmp_path / "injector.toml", "lump")
    plain = exported(tmp_path / "injector.toml", "wave")
    flow = worn.frozen.constants.coefficients.nozzle.flow
    assert flow == pytest.approx(1.3 * plain.frozen.constants.coefficients.nozzle.flow)


def test_document_with_terms(tmp_path: Path) -> None:
    it = exported(tmp_path / "injector.toml", "wave, terms")
    document = document_of(it.frozen, it.bench.injector.parameters)
    assert document["terms"][1] == {
        "equation": "line_pressure",
        "law": "c * sqrt(line_pressure - chamber_pressure) * closed",
        "coefficient": {"value": 0.1, "unit": "mm3/ms/MPa^0.5", "low": None, "high": None},
    }
    assert len(document["terms"]) == 9
    assert any("damping" in line for line in document["equations"])
