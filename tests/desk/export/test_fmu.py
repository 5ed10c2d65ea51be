"""FMUs of an export, run in FMPy: they do what the observer and the model here do."""

import ctypes
import re
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy import validation

from observer_rt.desk.export import fmu as module
from observer_rt.desk.export.fmu import write_fmu
from observer_rt.desk.export.model_description import CONTENTS
from tests.desk.export.exported import Exported, exported, learned

UNITS = re.compile(r"_(Pa|m|m3_per_s)$")
OF_MODEL_EXCHANGE = {  # which an FMU of 2.0 for co-simulation need not have
    *("fmi2EnterEventMode", "fmi2NewDiscreteStates", "fmi2EnterContinuousTimeMode", "fmi2SetTime"),
    *(
        "fmi2CompletedIntegratorStep",
        "fmi2SetContinuousStates",
        "fmi2GetDerivatives",
        "fmi2GetEventIndicators",
    ),
    *("fmi2GetContinuousStates", "fmi2GetNominalsOfContinuousStates"),
}
BOTH = pytest.mark.parametrize("version", [2, 3])
EACH = pytest.mark.parametrize("content", CONTENTS)


@pytest.fixture(scope="module")
def effects(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return exported(tmp_path_factory.mktemp("model") / "injector.toml", "effects", learned())


def simulated(path: Path, it: Exported, content: str, **start_values: float) -> Any:
    """What FMPy makes of the inputs of a reference run, step by step."""
    columns = {
        UNITS.sub("", name): values for name, values in it.runs[content].inputs.items() if name != "time_s"
    }
    interval = it.frozen.constants.interval
    time = np.arange(len(next(iter(columns.values())))) * interval
    rows = list(zip(time, *columns.values(), strict=True))
    given = np.array(rows, dtype=[("time", float), *((name, float) for name in columns)])
    every = {"step_size": interval, "output_interval": interval}
    return fmpy.simulate_fmu(str(path), stop_time=time[-1], input=given, start_values=start_values, **every)


def furthest(found: Any, it: Exported, content: str) -> float:
    """Largest difference from the reference run, of the largest value of its column."""
    behind = 1 + (it.frozen.constants.timing.lookahead if content == "observer" else 0)
    worst = 0.0
    for name, values in it.runs[content].outputs.items():
        if name != "time_s":
            shown = found[UNITS.sub("", name)][behind : behind + len(values)].astype(float)
            worst = max(worst, float(np.abs(shown - values[: len(shown)]).max() / np.abs(values).max()))
    return worst


@BOTH
@EACH
def test_runs_in_fmpy(tmp_path: Path, effects: Exported, content: str, version: int) -> None:
    path = tmp_path / "it.fmu"
    assert write_fmu(path, effects.frozen, content, version)
    assert validation.validate_fmu(path) == []
    assert fmpy.supported_platforms(str(path))
    assert furthest(simulated(path, effects, content), effects, content) < 1e-6


@BOTH
def test_another_number_is_seen(tmp_path: Path, effects: Exported, version: int) -> None:
    """As is another start value of a parameter."""
    path = tmp_path / "it.fmu"
    it = effects.frozen
    c = it.constants.coefficients
    other = c._replace(sac=c.sac._replace(a6=1.001 * c.sac.a6))
    changed = replace(it, constants=it.constants._replace(coefficients=other))
    write_fmu(path, changed, "observer", version)
    assert furthest(simulated(path, effects, "observer"), effects, "observer") > 1e-4
    write_fmu(path, it, "observer", version)
    assert furthest(simulated(path, effects, "observer", lift_zero=1e-6), effects, "observer") > 1e-4


@BOTH
@EACH
def test_sources_alone_where_there_is_no_compiler(
    tmp_path: Path, effects: Exported, monkeypatch: pytest.MonkeyPatch, content: str, version: int
) -> None:
    monkeypatch.setattr(module, "compiler", lambda: None)
    path = tmp_path / "it.fmu"
    assert not write_fmu(path, effects.frozen, content, version)
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        listing = "modelDescription.xml" if version == 2 else "sources/buildDescription.xml"
        listed = set(re.findall(r'<(?:Source)?File name="([^"]+)"', archive.read(listing).decode()))
        assert not any(name.startswith("binaries") for name in names)
    assert listed == {name.removeprefix("sources/") for name in names if name.endswith(".c")}
    assert "unit_token.h" in {name.removeprefix("sources/") for name in names}
    assert validation.validate_fmu(path) == []


def test_the_same_export_gives_the_same_token(tmp_path: Path, effects: Exported) -> None:
    first, second, other = (tmp_path / f"{name}.fmu" for name in ("first", "second", "other"))
    write_fmu(first, effects.frozen, "injector", 3)
    write_fmu(second, effects.frozen, "injector", 3)
    write_fmu(other, effects.frozen, "injector", 2)
    tokens = [fmpy.read_model_description(str(path)).guid for path in (first, second, other)]
    assert tokens[0] == tokens[1] != tokens[2]


@BOTH
def test_every_function_of_the_standard_is_there(tmp_path: Path, effects: Exported, version: int) -> None:
    write_fmu(tmp_path / "it.fmu", effects.frozen, "observer", version)
    with zipfile.ZipFile(tmp_path / "it.fmu") as archive:
        archive.extractall(tmp_path)
    library = ctypes.CDLL(str(next((tmp_path / "binaries").rglob("observer.*"))))
    header = (Path(fmpy.__file__).parent / "c-code" / f"fmi{version}Functions.h").read_text()
    names = (
        set(re.findall(rf"FMI{version}_Export fmi{version}\w+\s+(fmi{version}\w+)", header))
        - OF_MODEL_EXCHANGE
    )
    assert len(names) > 25
    assert [name for name in names if not hasattr(library, name)] == []


@BOTH
def test_steps_off_the_grid_and_other_tokens_are_refused(
    tmp_path: Path, effects: Exported, version: int
) -> None:
    path = tmp_path / "it.fmu"
    write_fmu(path, effects.frozen, "injector", version)
    folder = fmpy.extract(str(path), str(tmp_path / "unzipped"))
    description = fmpy.read_model_description(folder)
    with pytest.raises(Exception, match=r"[dD]oStep"):
        fmpy.simulate_fmu(folder, stop_time=1e-3, step_size=1.5e-5, output_interval=1.5e-5)
    description.guid = description.instantiationToken = "another"
    with pytest.raises(Exception, match=r"[Ii]nstantiat"):
        fmpy.instantiate_fmu(folder, description, fmi_type="CoSimulation")
