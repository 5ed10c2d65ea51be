"""Fitted candidates on disk."""

from pathlib import Path

import numpy as np

from observer_rt.identification.discovery.folder import FitStore, problem_key
from observer_rt.model.effects import sized
from tests.identification.discovery.hidden import NOMINAL
from tests.identification.discovery.test_amend import LEAK

IDS, THETA, STATISTIC, SPREAD = (
    ("orifice_area", "line_friction"),
    np.array([0.1 + 0.2, -1e-300]),
    -207_000.123456789,
    1.1,
)


def _stored(path: Path, key: str) -> None:
    with FitStore(path, key) as store:
        store[IDS] = THETA, STATISTIC, SPREAD


def test_fits_come_back_bit_by_bit(tmp_path: Path) -> None:
    path = tmp_path / "fits.jsonl"
    _stored(path, "key")
    with FitStore(path, "key") as store:
        assert store.taken_over == len(store) == 1
        result = store.get(IDS)
        assert result is not None
        assert result[0].tobytes() == THETA.tobytes()
        assert result[1:] == (STATISTIC, SPREAD)
        assert store.get(IDS[:1]) is None


def test_fits_of_another_problem_are_forgotten(tmp_path: Path) -> None:
    path = tmp_path / "fits.jsonl"
    _stored(path, "key")
    with FitStore(path, "other") as store:
        assert store.get(IDS) is None
    with FitStore(path, "key") as store:
        assert store.taken_over == 0


def test_a_line_cut_off_ends_what_is_read(tmp_path: Path) -> None:
    path = tmp_path / "fits.jsonl"
    _stored(path, "key")
    complete = path.read_bytes()
    path.write_bytes(complete + b'{"ids": ["seat_area"], "theta": [0.')
    with FitStore(path, "key") as store:
        assert store.taken_over == 1
    assert path.read_bytes() == complete


def test_anything_else_under_that_name_is_begun_anew(tmp_path: Path) -> None:
    path = tmp_path / "fits.jsonl"
    for content in (b"", b"\xff\x00", b"[]\n{}\n", b'{"format": 1, "key": "key"}\n[1]\n'):
        path.write_bytes(content)
        with FitStore(path, "key") as store:
            assert len(store) == 0


def test_the_key_follows_model_and_recordings_but_not_why_an_effect_is_believed() -> None:
    key = problem_key(NOMINAL, ["a", "b"])
    assert problem_key(NOMINAL, ["a", "c"]) != key
    assert problem_key(NOMINAL, ["a", "b"], [sized("channel_skew", d=1e-6)]) != key
    leaking = NOMINAL.model_copy(update={"effects": (LEAK,)})
    assert problem_key(leaking, ["a", "b"]) != key
    other_reason = LEAK.model_copy(update={"evidence": "a puddle"})
    assert problem_key(NOMINAL.model_copy(update={"effects": (other_reason,)}), ["a", "b"]) == problem_key(
        leaking, ["a", "b"]
    )
