"""The learned state on disk: exact, whole at any time, restored only where it belongs."""

import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from observer_rt.config.bench import load_injector
from observer_rt.estimation.gain import NoiseLevels
from observer_rt.estimation.scalars import PARAMETERS, SCALARS, Parameter
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.observer.learning.knowledge import Knowledge, no_knowledge
from observer_rt.observer.learning.memory import NOTHING
from observer_rt.service.keeping.state_file import load_knowledge, model_hash, save_knowledge
from tests.service.knowledge_samples import PRESSURE_SCALE, damage, some_knowledge

MODEL = model_hash(load_injector())
NOISE = NoiseLevels(rail_pressure=0.1e6, line_pressure=0.15e6, needle_lift=0.4e-6)
in_one_folder = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)


def same(left: Knowledge | None, right: Knowledge) -> bool:
    """Whether two pieces of knowledge agree in every bit."""
    return left is not None and bits(left) == bits(right)


def bits(knowledge: Knowledge) -> tuple[object, ...]:
    """Every field of a piece of knowledge, arrays by their bytes."""
    fields = dict(vars(knowledge)) | knowledge.belief.parts | vars(knowledge.statistics)
    if knowledge.colour is not None:
        fields |= vars(knowledge.colour) | vars(knowledge.colour.whitening)
        del fields["whitening"]
    del fields["belief"], fields["statistics"], fields["colour"]
    return tuple(v.tobytes() if isinstance(v, np.ndarray) else v for v in fields.values())


@in_one_folder
@given(seed=st.integers(0, 2**32), phi_version=st.integers(0, 2**40), events=st.integers(0, 2**40))
def test_what_is_saved_is_restored_to_the_bit(
    tmp_path: Path, seed: int, phi_version: int, events: int
) -> None:
    knowledge = some_knowledge(seed, phi_version, events)
    save_knowledge(tmp_path / "state.json", knowledge, MODEL)
    assert same(load_knowledge(tmp_path / "state.json", MODEL).knowledge, knowledge)
    assert [path.name for path in tmp_path.iterdir()] == ["state.json"]


def test_the_prior_can_be_saved(tmp_path: Path) -> None:
    prior = no_knowledge(NOISE, PRESSURE_SCALE)
    assert prior.belief.information.shape  # what is kept of that is nothing to be saved
    save_knowledge(tmp_path / "state.json", prior, MODEL)
    restored = load_knowledge(tmp_path / "state.json", MODEL)
    assert same(restored.knowledge, prior)
    assert "restored" in restored.message


def test_no_file_means_the_prior(tmp_path: Path) -> None:
    restored = load_knowledge(tmp_path / "state.json", MODEL)
    assert restored.knowledge is None
    assert restored.message == f"no learned state at {tmp_path / 'state.json'}, starting from the prior"


@in_one_folder
@given(data=st.data())
def test_a_damaged_file_is_restored_equal_or_set_aside(tmp_path: Path, data: st.DataObject) -> None:
    path, knowledge = tmp_path / "state.json", some_knowledge()
    save_knowledge(path, knowledge, MODEL)
    content = damage(path, data)
    restored = load_knowledge(path, MODEL)
    if restored.knowledge is None:
        assert not path.exists()
        kept = Path(restored.message.rsplit("kept as ", 1)[1])
        assert kept.read_bytes() == content
        kept.unlink()
    else:
        assert same(restored.knowledge, knowledge)
        assert path.exists()


def rewritten(path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Change a state file as an evil twin of the writer would: with a checksum that is right."""
    document = json.loads(path.read_bytes())
    change(document)
    canonical = json.dumps(document["content"], sort_keys=True, separators=(",", ":"))
    document["sha256"] = hashlib.sha256(canonical.encode()).hexdigest()
    path.write_text(json.dumps(document))


def put(*keys: str | int, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(document: dict[str, Any]) -> None:
        target: Any = document
        for key in keys[:-1]:
            target = target[key]
        target[keys[-1]] = value

    return change


def remove(key: str) -> Callable[[dict[str, Any]], None]:
    def change(document: dict[str, Any]) -> None:
        del document["content"][key]

    return change


NOT_RESTORED = {
    "older version": (put("version", value=1), r"version 1, not 4 (observer_rt "),
    "newer version": (put("version", value=5), "format is version 5, not 4"),
    "a name twice": (put("content", "columns", 0, value="lag"), "as many parameters as it names"),
    "a name too few": (
        put("content", "columns", value=list(SCALARS.names[:-1])),
        "as many parameters as it names",
    ),
    "model": (put("content", "model_sha256", value="0" * 64), "another injector model"),
    "short mean": (put("content", "mean", value=[0.0] * (PARAMETERS - 1)), "as many parameters"),
    "flat covariance": (put("content", "covariance", value=[1.0] * PARAMETERS), "shape"),
    "ragged": (put("content", "covariance", value=[[1.0], [1.0, 2.0]]), "not as expected (covariance"),
    "text": (put("content", "mean", value="none"), "not as expected (mean"),
    "nan": (put("content", "mean", 0, value=float("nan")), "not a learned state"),
    "too large a number": (put("content", "mean", 0, value=10**400), "not a learned state"),
    "negative error": (put("content", "error_covariance", 2, 2, value=-1.0), "error's covariance"),
    "asymmetric": (put("content", "covariance", 0, 1, value=0.9), "symmetric"),
    "negative variance": (put("content", "covariance", 2, 2, value=-1.0), "positive definite"),
    "wear beyond bounds": (put("content", "mean", int(Parameter.NOZZLE_BIAS), value=1.51), "beyond"),
    "impossible leak": (put("content", "in_force", int(Parameter.GUIDE_LEAKAGE), value=-1e-9), "beyond"),
    "active network": (put("content", "active", value=[int(Parameter.NOZZLE_BIAS)]), "left out"),
    "active fraction": (
        put("content", "active", value=[float(Parameter.SENSOR_LAG)]),
        "not as expected (active",
    ),
    "endless filter": (put("content", "colour", "taps", value=[0.1] * 30), "no filter"),
    "high pass that grows": (put("content", "colour", "forgetting", value=1.5), "high pass"),
    "noise of no level": (put("content", "colour", "sigma", value=0.0), "no level"),
    "short statistics": (put("content", "statistics", "squares", value=[1.0]), "shape"),
    "negative statistics": (put("content", "statistics", "blocks", 0, 0, value=-1.0), "sums of squares"),
    "offset beyond bounds": (
        put("content", "in_force", int(Parameter.LINE_PRESSURE_OFFSET), value=-0.101),
        "beyond",
    ),
    "no noise": (put("content", "noise", "line_pressure", value=0.0), "line pressure"),
    "much noise": (put("content", "noise", "needle_lift", value=1e-4), "needle lift"),
    "noise of another signal": (put("content", "noise", "x", value=1.0), "not as expected"),
    "missing": (remove("in_force"), "in_force"),
    "negative count": (put("content", "events", value=-1), "not as expected (events"),
    "fractional count": (put("content", "phi_version", value=1.5), "not as expected (phi_version"),
    "no object": (put("content", value=[]), "not as expected"),
}


@pytest.mark.parametrize(("change", "reason"), NOT_RESTORED.values(), ids=NOT_RESTORED)
def test_what_cannot_be_used_is_set_aside(
    tmp_path: Path, change: Callable[[dict[str, Any]], None], reason: str
) -> None:
    path = tmp_path / "state.json"
    save_knowledge(path, some_knowledge(), MODEL)
    rewritten(path, change)
    before = path.read_bytes()
    restored = load_knowledge(path, MODEL)
    assert restored.knowledge is None
    assert reason in restored.message
    kept = tmp_path / "state.json.set-aside-1"
    assert str(kept) in restored.message
    assert kept.read_bytes() == before
    assert not path.exists()


def test_a_rewritten_file_without_change_is_restored(tmp_path: Path) -> None:
    """The cases above are set aside for what was changed, not for having been rewritten."""
    save_knowledge(tmp_path / "state.json", some_knowledge(), MODEL)
    rewritten(tmp_path / "state.json", put("content", "package_version", value="0.0.1"))
    assert same(load_knowledge(tmp_path / "state.json", MODEL).knowledge, some_knowledge())


def test_a_file_of_the_version_before_is_restored(tmp_path: Path) -> None:
    """It names no parameters, and remembers nothing of what learning follows."""
    save_knowledge(tmp_path / "state.json", some_knowledge(), MODEL)

    def older(document: dict[str, Any]) -> None:
        document["version"] = 3
        del document["content"]["columns"], document["content"]["memory"]

    rewritten(tmp_path / "state.json", older)
    restored = load_knowledge(tmp_path / "state.json", MODEL).knowledge
    assert same(restored, replace(some_knowledge(), memory=NOTHING))


def test_parameters_are_known_by_name(tmp_path: Path) -> None:
    """In another order, with one that there is no more; what the file does not know is as before any event."""
    known, prior = some_knowledge(), no_knowledge(some_knowledge().noise, PRESSURE_SCALE)
    order = np.random.default_rng(4).permutation(PARAMETERS)
    gone = int(Parameter.NOZZLE_BIAS)

    def other(document: dict[str, Any]) -> None:
        content = document["content"]
        for part in ("in_force", "mean"):
            content[part] = np.array(content[part])[order].tolist()
        for part in ("covariance", "error_covariance"):
            content[part] = np.array(content[part])[np.ix_(order, order)].tolist()
        content["columns"] = [SCALARS.names[column] if column != gone else "once" for column in order]
        content["active"] = [order.tolist().index(column) for column in content["active"]]

    save_knowledge(tmp_path / "state.json", known, MODEL)
    rewritten(tmp_path / "state.json", other)
    restored = load_knowledge(tmp_path / "state.json", MODEL, PRESSURE_SCALE).knowledge
    assert restored is not None
    kept = np.arange(PARAMETERS) != gone
    assert restored.active == known.active
    np.testing.assert_array_equal(restored.in_force[kept], known.in_force[kept])
    np.testing.assert_array_equal(
        restored.belief.covariance[np.ix_(kept, kept)], known.belief.covariance[np.ix_(kept, kept)]
    )
    assert restored.in_force[gone] == 0.0
    np.testing.assert_array_equal(restored.belief.covariance[gone], prior.belief.covariance[gone])


def test_a_file_from_before_colours_has_none(tmp_path: Path) -> None:
    save_knowledge(tmp_path / "state.json", some_knowledge(), MODEL)
    rewritten(tmp_path / "state.json", remove("colour"))
    restored = load_knowledge(tmp_path / "state.json", MODEL).knowledge
    assert same(restored, replace(some_knowledge(), colour=None))


@pytest.mark.parametrize("content", [b"", b"[" * 200_000, b"\xff\xfe", b"null", b"9" * 5_000, bytes(2 << 20)])
def test_other_files_are_set_aside(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "state.json"
    path.write_bytes(content)
    assert load_knowledge(path, MODEL).knowledge is None
    assert not path.exists()


def test_nothing_set_aside_is_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    for number in range(3):
        path.write_text(f"damage {number}")
        load_knowledge(path, MODEL)
    assert [(tmp_path / f"state.json.set-aside-{n + 1}").read_text() for n in range(3)] == [
        f"damage {n}" for n in range(3)
    ]


def test_the_offset_bound_is_in_pascal(tmp_path: Path) -> None:
    """0.15 p_0 is 15 MPa for p_0 = 100 MPa, and 7.5 MPa for half of that; 10 MPa are allowed."""
    knowledge = some_knowledge()
    knowledge.in_force[Parameter.LINE_PRESSURE_OFFSET] = 0.15
    with pytest.raises(RunError, match="beyond"):
        save_knowledge(tmp_path / "state.json", knowledge, MODEL)
    save_knowledge(tmp_path / "state.json", knowledge, MODEL, pressure_scale=0.5e8)
    assert same(load_knowledge(tmp_path / "state.json", MODEL, pressure_scale=0.5e8).knowledge, knowledge)


def test_what_could_not_be_restored_does_not_replace_a_good_file(tmp_path: Path) -> None:
    path, good = tmp_path / "state.json", some_knowledge()
    save_knowledge(path, good, MODEL)
    broken = replace(good, belief=replace(good.belief, mean=np.full(PARAMETERS, np.nan)))
    with pytest.raises(RunError, match="not finite"):
        save_knowledge(path, broken, MODEL)
    assert same(load_knowledge(path, MODEL).knowledge, good)


KILLED_BEFORE_RENAME = """
import os, signal, sys
from pathlib import Path
from observer_rt.estimation.gain import NoiseLevels
from observer_rt.observer.learning.knowledge import no_knowledge
from observer_rt.service.keeping.state_file import save_knowledge
os.replace = lambda source, target: os.kill(os.getpid(), signal.SIGKILL)
save_knowledge(Path(sys.argv[1]), no_knowledge(NoiseLevels(1e5, 1e5, 1e-6), 1e8), sys.argv[2])
"""


def test_a_kill_before_the_rename_leaves_the_old_file(tmp_path: Path) -> None:
    path, old = tmp_path / "state.json", some_knowledge()
    save_knowledge(path, old, MODEL)
    killed = subprocess.run([sys.executable, "-c", KILLED_BEFORE_RENAME, str(path), MODEL], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert same(load_knowledge(path, MODEL).knowledge, old)
    new = some_knowledge(2)
    save_knowledge(path, new, MODEL)  # what the killed process left behind is in nobody's way
    assert same(load_knowledge(path, MODEL).knowledge, new)
    assert [entry.name for entry in tmp_path.iterdir()] == ["state.json"]


def test_a_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, old = tmp_path / "state.json", some_knowledge()
    save_knowledge(path, old, MODEL)

    def disk_is_full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", disk_is_full)
    with pytest.raises(RunError, match="No space left"):
        save_knowledge(path, some_knowledge(2), MODEL)
    assert same(load_knowledge(path, MODEL).knowledge, old)
    assert [entry.name for entry in tmp_path.iterdir()] == ["state.json"]


def test_a_symbolic_link_stays_one(tmp_path: Path) -> None:
    (tmp_path / "link.json").symlink_to(tmp_path / "state.json")
    save_knowledge(tmp_path / "link.json", some_knowledge(), MODEL)
    assert (tmp_path / "link.json").is_symlink()
    assert same(load_knowledge(tmp_path / "state.json", MODEL).knowledge, some_knowledge())


def test_paths_that_are_no_file(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="is no file"):
        load_knowledge(tmp_path, MODEL)
    with pytest.raises(UserError, match="is no file"):
        load_knowledge(Path("/dev/null"), MODEL)
    with pytest.raises(UserError, match="no existing folder"):
        load_knowledge(tmp_path / "missing" / "state.json", MODEL)
    with pytest.raises(RunError, match="cannot be written"):
        save_knowledge(tmp_path / "missing" / "state.json", some_knowledge(), MODEL)


def test_a_file_that_may_not_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulated, because the superuser may read everything."""
    path = tmp_path / "state.json"
    save_knowledge(path, some_knowledge(), MODEL)

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(UserError, match="Permission denied"):
        load_knowledge(path, MODEL)


def test_the_model_hash_tells_models_apart_but_not_their_spelling(tmp_path: Path) -> None:
    injector = load_injector()
    worn = injector.model_copy(
        update={"nozzle": injector.nozzle.model_copy(update={"hole_diameter": 0.18e-3})}
    )
    assert len(MODEL) == 64
    assert model_hash(worn) != MODEL
    text = (Path(__file__).parents[2] / "observer_rt" / "data" / "crin3_nominal.toml").read_text()
    respelt = tmp_path / "injector.toml"
    respelt.write_text(text.replace("0.9e-6", "900e-9").replace("holes = 8", "holes = 8  # eight"))
    assert model_hash(load_injector(respelt)) == MODEL
