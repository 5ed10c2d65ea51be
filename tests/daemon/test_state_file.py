"""The learned state on disk: exact, whole at any time, restored only where it belongs."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from functools import reduce
from operator import delitem, getitem, setitem
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.daemon.array_texts import ArrayTexts
from observer_rt.daemon.state_file import VERSION, RestoredKnowledge, load_knowledge, model_hash, save_knowledge
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.engine.estimation.parameters import PARAMETERS, SCALARS, Parameter
from observer_rt.engine.estimation.predictor import NoiseLevels
from observer_rt.engine.learning.knowledge import Knowledge, no_knowledge
from observer_rt.engine.stream.standstill import HeldRail
from observer_rt.foundation.documents import Section
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.foundation.records import to_plain
from observer_rt.model.effective import LAG_UNIT
from observer_rt.model.parameters import InjectorParameters, LineOutflow, LineParameters
from tests.daemon.samples import PRESSURE_SCALE, damage, some_knowledge
from tests.device import simulated

MODEL = load_injector()
OTHER = MODEL.model_copy(update={"line_outflow": LineOutflow.SEAT})
NOISE = NoiseLevels(rail_pressure=0.1e6, line_pressure=0.15e6, needle_lift=0.4e-6)
Change = Callable[[dict[str, Any]], object]


def agree(first: Any, second: Any) -> bool:
    """Whether two values agree: matrices as far as float32 tells them apart, all else in every bit."""
    if isinstance(first, np.ndarray) and first.ndim > 1:
        return np.allclose(first, second, rtol=0.0, atol=1e-6 * np.abs(first).max(initial=0.0))
    if isinstance(first, dict):
        return first.keys() == second.keys() and all(agree(each, second[name]) for name, each in first.items())
    if isinstance(first, list):
        return len(first) == len(second) and all(map(agree, first, second))
    return bool(np.array_equal(first, second))


class StateFile:
    """A state file in a folder, as its writer would change it, and as an evil twin of it."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "state.json"

    def save(self, knowledge: Knowledge | None = None) -> Knowledge:
        knowledge = knowledge or some_knowledge()
        save_knowledge(self.path, knowledge, MODEL)
        return knowledge

    def load(self) -> RestoredKnowledge:
        return load_knowledge(self.path, MODEL)

    def holds(self, knowledge: Knowledge) -> bool:
        restored = self.load().knowledge
        return restored is not None and agree(to_plain(restored), to_plain(knowledge))

    def rewrite(self, change: Change) -> bytes:
        document = json.loads(self.path.read_bytes())
        content = document["content"]  # whose arrays may also be lists
        content["state"] = ArrayTexts(content["arrays"]).put_in(content["state"])
        document = json.loads(json.dumps(document, default=np.ndarray.tolist))
        change(document)
        canonical = json.dumps(document["content"], sort_keys=True, separators=(",", ":"))
        document["sha256"] = hashlib.sha256(canonical.encode()).hexdigest()
        self.path.write_text(json.dumps(document))
        return self.path.read_bytes()


@pytest.fixture
def state(tmp_path: Path) -> StateFile:
    return StateFile(tmp_path)


@given(seed=st.integers(0, 2**32), phi_version=st.integers(0, 2**40), events=st.integers(0, 2**40))
def test_what_is_saved_is_restored(state: StateFile, seed: int, phi_version: int, events: int) -> None:
    assert state.holds(state.save(some_knowledge(seed, phi_version, events)))
    assert [*state.path.parent.iterdir()] == [state.path]


def test_the_prior_can_be_saved(state: StateFile) -> None:
    prior = no_knowledge(NOISE, PRESSURE_SCALE)
    assert prior.state.learned.belief.information.shape  # what is kept of that is nothing to be saved
    assert state.holds(state.save(prior))
    assert "restored" in state.load().message


def test_no_file_means_the_prior(state: StateFile) -> None:
    restored = state.load()
    assert restored.knowledge is None
    assert restored.message == f"no learned state at {state.path}, starting from the prior"


@given(data=st.data())
def test_a_damaged_file_is_restored_equal_or_set_aside(state: StateFile, data: st.DataObject) -> None:
    knowledge = state.save()
    content = damage(state.path, data)
    try:
        restored = state.load()
    except UserError:  # nothing says any more what it was
        assert state.path.read_bytes() == content
        return
    if restored.knowledge is None:
        assert not state.path.exists()
        kept = Path(restored.message.splitlines()[0].rsplit("kept as ", 1)[1])
        assert kept.read_bytes() == content
        kept.unlink()
    else:
        assert agree(to_plain(restored.knowledge), to_plain(knowledge))
        assert state.path.exists()


def put(*keys: str | int, value: Any) -> Change:
    return lambda document: setitem(reduce(getitem, keys[:-1], document["content"]), keys[-1], value)


def remove(*keys: str | int) -> Change:
    return lambda document: delitem(reduce(getitem, keys[:-1], document["content"]), keys[-1])


LEARNED = ("state", "account", "learned")
MEAN = (*LEARNED, "belief", "mean")
COVARIANCE = (*LEARNED, "belief", "covariance")
NOT_RESTORED = {
    "older version": (lambda kept: kept.update(version=1), f"version 1, not {VERSION} (observer_rt "),
    "newer version": (lambda kept: kept.update(version=VERSION + 1), f"is version {VERSION + 1}, not {VERSION}"),
    "another parameter": (put("columns", 0, value="lag"), "other parameters"),
    "a parameter too few": (put("columns", value=list(SCALARS.names[:-1])), "other parameters"),
    "model": (put("model_sha256", value="0" * 64), "another injector model"),
    "short mean": (put(*MEAN, value=[0.0] * (PARAMETERS - 1)), "learned.belief.mean: shape"),
    "no such text": (put(*COVARIANCE, value={"array": 99}), "not as expected"),
    "nan": (put(*MEAN, 0, value=float("nan")), "not as expected"),
    "too large a number": (put(*MEAN, 0, value=10**400), "not as expected"),
    "negative error": (put(*LEARNED, "belief", "error_covariance", 2, 2, value=-1.0), "error's covariance"),
    "asymmetric": (put(*COVARIANCE, 0, 1, value=0.9), "symmetric"),
    "negative variance": (put(*COVARIANCE, 2, 2, value=-1.0), "positive definite"),
    "wear beyond bounds": (put(*MEAN, int(Parameter.NOZZLE_BIAS), value=1.51), "beyond"),
    "impossible leak": (put("in_force", int(Parameter.GUIDE_LEAKAGE), value=-1e-9), "beyond"),
    "slower than any sensor": (put(*MEAN, int(Parameter.SENSOR_LAG), value=0.3e-3 / LAG_UNIT), "0.3 ms"),
    "nozzle at its limit": (put(*MEAN, int(Parameter.NOZZLE_BIAS), value=1.5), "at the limit"),
    "active network": (put(*LEARNED, "active", value=[int(Parameter.NOZZLE_BIAS)]), "left out"),
    "offset beyond bounds": (put("in_force", int(Parameter.LINE_PRESSURE_OFFSET), value=-0.101), "beyond"),
    "no noise": (put("state", "noise", "line_pressure", value=0.0), "line pressure"),
    "much noise": (put("state", "noise", "needle_lift", value=1e-4), "needle lift"),
    "a zero further than drift goes": (put("lift", "zero", value=41e-6), "shut needle"),
    "crosstalk beyond any": (put("lift", "crosstalk", value=-0.6e-12), "shut needle"),
    "noise of another signal": (put("state", "noise", "x", value=1.0), "not as expected (noise"),
    "missing": (remove("in_force"), "in_force"),
    "no lift": (remove("lift"), "lift"),
    "negative count": (put("state", "events", value=-1), "not as expected (events"),
    "no object": (lambda document: document.update(content=[]), "not as expected"),
}


@pytest.mark.parametrize(("change", "reason"), NOT_RESTORED.values(), ids=NOT_RESTORED)
def test_what_cannot_be_used_is_set_aside(state: StateFile, change: Change, reason: str) -> None:
    state.save()
    content = state.rewrite(change)
    restored = state.load()
    assert restored.knowledge is None
    assert reason in restored.message
    kept = state.path.with_name("state.json.set-aside-1")
    assert str(kept) in restored.message
    assert kept.read_bytes() == content
    assert not state.path.exists()


def without_held_rail(knowledge: Knowledge) -> Knowledge:
    return replace(knowledge, state=replace(knowledge.state, held_rail=HeldRail()))


LOST: dict[str, tuple[Change, Callable[[Knowledge], Knowledge]]] = {
    # the cases above do not fail for being rewritten
    "no change": (put("package_version", value="0.0.1"), lambda known: known),
    "a held rail": (remove("state", "held_rail"), without_held_rail),
    "its kind": (put("state", "held_rail", "events", value="many"), without_held_rail),
}


@pytest.mark.parametrize(("change", "lost"), LOST.values(), ids=LOST)
def test_what_a_file_does_not_tell_is_not_known(
    state: StateFile, change: Change, lost: Callable[[Knowledge], Knowledge]
) -> None:
    knowledge = state.save()
    state.rewrite(change)
    assert state.holds(lost(knowledge))


@pytest.mark.parametrize(
    "content", [b"", b'{"version": 6, "sha256": ' + b"[" * 200_000, b'{"version": 9' * 5_000, bytes(2 << 20)]
)
def test_what_is_left_of_a_state_is_set_aside(state: StateFile, content: bytes) -> None:
    state.path.write_bytes(content)
    assert state.load().knowledge is None
    assert not state.path.exists()


@pytest.mark.parametrize("content", [b"[" * 200_000, b"\xff\xfe", b"null", b"time_s,rail_pressure_MPa\n"])
def test_what_was_no_state_is_refused_and_stays(state: StateFile, content: bytes) -> None:
    state.path.write_bytes(content)
    with pytest.raises(UserError, match="not a learned state"):
        state.load()
    assert state.path.read_bytes() == content


def test_a_file_larger_than_any_state_is_not_read_to_its_end(state: StateFile) -> None:
    state.save()
    state.path.write_bytes(b" " * (1 << 22) + state.path.read_bytes())
    with pytest.raises(UserError, match="not a learned state"):
        state.load()


def test_nothing_set_aside_is_overwritten(state: StateFile) -> None:
    for number in range(3):
        state.path.write_text(f'{{"version": {number}')
        state.load()
    for number in range(3):
        kept = state.path.with_name(f"state.json.set-aside-{number + 1}")
        assert kept.read_text() == f'{{"version": {number}'


def test_a_state_of_many_injections_is_small_and_judges_as_if_never_on_disk(state: StateFile) -> None:
    bench, pressures = load_bench(), (60e6, 100e6, 140e6)
    learned = evaluate(bench, [simulated(20, 0.2, pressures, 100e3, seed=3)]).knowledge
    state.save(learned)
    assert state.path.stat().st_size <= 60_000
    restored = state.load().knowledge
    following = simulated(4, 0.2, pressures, 100e3, seed=4)
    as_it_was, again = (evaluate(bench, [following], each).evaluations[0].reports for each in (learned, restored))
    assert all(each.valid for each in as_it_was)
    for before, after in zip(as_it_was, again, strict=True):
        assert (before.valid, before.reasons) == (after.valid, after.reasons)
        assert after.mass == pytest.approx(before.mass, rel=1e-5)
        assert after.mass_ci95 == pytest.approx(before.mass_ci95, rel=1e-4)


def test_the_offset_bound_is_in_pascal(state: StateFile) -> None:
    """0.15 p_0 is 15 MPa for p_0 = 100 MPa, and 1.2 MPa for 8 MPa; 10 MPa may be learned."""
    knowledge = some_knowledge()
    knowledge.in_force[Parameter.LINE_PRESSURE_OFFSET] = 0.15
    with pytest.raises(RunError, match="beyond"):
        state.save(knowledge)
    other = MODEL.model_copy(update={"scaling": MODEL.scaling.model_copy(update={"pressure": 0.08e8})})
    save_knowledge(state.path, knowledge, other)
    restored = load_knowledge(state.path, other).knowledge
    assert restored is not None
    assert agree(to_plain(restored), to_plain(knowledge))


def test_what_could_not_be_restored_does_not_replace_a_good_file(state: StateFile) -> None:
    good = state.save()
    belief = replace(good.state.learned.belief, mean=np.full(PARAMETERS, np.nan))
    with pytest.raises(RunError, match="not finite"):
        state.save(replace(good, state=good.state.map(lambda learned: replace(learned, belief=belief))))
    assert state.holds(good)


def test_paths_that_are_no_file(tmp_path: Path) -> None:
    for path in (tmp_path, Path("/dev/null")):
        with pytest.raises(UserError, match="is no file"):
            load_knowledge(path, MODEL)
    with pytest.raises(UserError, match="no existing folder"):
        load_knowledge(tmp_path / "missing" / "state.json", MODEL)
    with pytest.raises(RunError, match="cannot be written"):
        save_knowledge(tmp_path / "missing" / "state.json", some_knowledge(), MODEL)


def test_a_file_that_may_not_be_read(state: StateFile, monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulated, because the superuser may read everything."""
    state.save()
    monkeypatch.setattr(Path, "open", Mock(side_effect=PermissionError(13, "Permission denied")))
    with pytest.raises(UserError, match="Permission denied"):
        state.load()


def test_the_model_hash_tells_models_apart_but_not_their_spelling(tmp_path: Path) -> None:
    assert model_hash(OTHER) != model_hash(MODEL)
    text = (Path(__file__).parents[2] / "observer_rt" / "data" / "crin3_nominal.toml").read_text()
    respelt = tmp_path / "injector.toml"
    respelt.write_text(text.replace("0.9e-6", "900e-9").replace("holes = 8", "holes = 8  # eight"))
    assert model_hash(load_injector(respelt)) == model_hash(MODEL)


@pytest.mark.parametrize(
    ("section", "keys", "begin"),
    [
        ("scaling", {}, "16ad6765d5c8654d"),
        ("needle", {"landing_bounce": 2e-5}, "30cd493ed42c5ebb"),
        ("line", {"control_flow": 0.0}, "e0aff5a9aa0e90f9"),
        ("line", {"model": "wave", "cells": 8, "damping": 0.0}, "fd90cdf21a52d395"),
        ("fluid", {"reference_temperature": None}, "3b21098db77c06a8"),
    ],
)
def test_an_injector_file_is_the_model_of_earlier_versions(section: str, keys: dict[str, Any], begin: str) -> None:
    """Else what was learned for it, and evidence kept with it, would be of another model after an update."""
    changed = getattr(MODEL, section).model_copy(update=keys)
    assert model_hash(MODEL.model_copy(update={section: changed})).startswith(begin)


def test_what_an_injector_file_may_have_later_makes_no_other_model_while_it_is_at_its_default() -> None:
    class LaterLine(LineParameters):
        taper: float = 1.0

    class Body(Section):
        stiffness: float | None = None

    class LaterParameters(InjectorParameters):
        line: LaterLine
        body: Body = Body()

    def hashed(line: dict[str, float], body: dict[str, float]) -> str:
        document = MODEL.model_dump()
        return model_hash(LaterParameters(**document | {"line": document["line"] | line, "body": body}))

    assert hashed({}, {}) == hashed({"taper": 1.0}, {}) == model_hash(MODEL)
    assert model_hash(MODEL) not in (hashed({"taper": 2.0}, {}), hashed({}, {"stiffness": 1.0}))
