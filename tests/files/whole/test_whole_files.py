"""Files that are read whole: damaged ones, those without their library, those that would do harm."""

import importlib.util
import os
import pickle
import random
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from observer_rt.files.formats import guessed, read_recording
from observer_rt.foundation.errors import UserError
from tests.device import simulated
from tests.files.layouts import LAYOUTS, Layout

OURS = simulated(1, 0.2, seed=5)
KINDS = [
    each
    for each in LAYOUTS
    if each.name
    in (
        "Excel", "MATLAB 5", "MATLAB 7.3", "HDF5", "MDF 3", "TDMS waveforms", "Feather", "NumPy arrays",
        "NumPy matrix", "packed", "text",
    )
]  # fmt: skip


def short(folder: Path, layout: Layout) -> Path:
    """A file of 60 samples."""
    few = OURS.with_arrays({name: values[:60] for name, values in OURS.arrays.items()})
    made = layout.make(folder, few)
    assert isinstance(made, Path)
    return made


def tells(path: Path) -> bool:
    """Whether a file gives columns to guess from, or an error that names it and says what to do."""
    try:
        guess = guessed(path)
    except UserError as error:
        return str(path) in str(error) and bool(error.remedy)
    return guess is not None and bool(guess.section())


@pytest.mark.parametrize("layout", KINDS, ids=lambda layout: layout.name)
def test_a_damaged_file_is_read_or_refused_by_name(tmp_path: Path, layout: Layout) -> None:
    path = short(tmp_path, layout)
    whole = path.read_bytes()

    @settings(
        max_examples=min(settings().max_examples, 25),
        deadline=None,
        suppress_health_check=[HealthCheck.function_scoped_fixture],
    )
    @given(seed=st.integers(0, 2**32), cuts=st.booleans(), garbage=st.binary(max_size=40))
    def check(seed: int, cuts: bool, garbage: bytes) -> None:
        place = random.Random(seed).randrange(len(whole))
        path.write_bytes(whole[:place] + garbage + (b"" if cuts else whole[place + len(garbage) :]))
        assert tells(path)

    check()


@pytest.mark.parametrize(
    ("suffix", "library", "package"),
    [(".xlsx", "openpyxl", "openpyxl"), (".h5", "h5py", "h5py"), (".tdms", "nptdms", "npTDMS")],
)
def test_a_missing_library_names_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, library: str, package: str
) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(
        "observer_rt.files.signals.whole_file.find_spec",
        lambda name: None if name == library else found(name),
    )
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"anything")
    with pytest.raises(UserError, match=rf"pip install {package}, or pip install 'observer-rt\[files\]'"):
        read_recording(path)


class Harmful:
    """What a pickle runs when it is loaded."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return os.mkdir, (str(self.path),)


@pytest.mark.parametrize("suffix", [".npy", ".npz"])
def test_nothing_in_a_file_is_executed(tmp_path: Path, suffix: str) -> None:
    harmful = np.array([Harmful(tmp_path / "made"), 1.0], object)
    path = tmp_path / f"a{suffix}"
    if suffix == ".npy":
        np.save(path, harmful, allow_pickle=True)
    else:
        np.savez(path, rail=harmful)
    with pytest.raises(UserError, match="pickle"):
        read_recording(path)
    path.write_bytes(pickle.dumps(harmful))
    with pytest.raises(UserError, match="damaged NumPy file"):
        read_recording(path)
    assert not (tmp_path / "made").exists()


def test_links_to_other_files_are_not_followed(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["values"] = np.arange(100.0)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["linked"] = h5py.ExternalLink("secret.h5", "values")
        file["again"] = h5py.SoftLink("/")
    with pytest.raises(UserError, match="holds no column of numbers"):
        read_recording(tmp_path / "a.h5")


def test_text_of_matlab_is_no_column(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"note": "a bench", "one": 3.0})
    with pytest.raises(UserError, match="holds no column of numbers"):
        read_recording(tmp_path / "a.mat")


@pytest.mark.parametrize(("name", "said"), [("a.mdf", "is no MDF file"), ("a.dat", "is no MDF file")])
def test_what_is_no_mdf_is_told(tmp_path: Path, name: str, said: str) -> None:
    (tmp_path / name).write_text("nothing of the kind")
    with pytest.raises(UserError, match=said):
        read_recording(tmp_path / name)


def test_mdf_4_under_the_name_of_mdf_3_names_its_suffix(tmp_path: Path) -> None:
    (layout,) = (each for each in LAYOUTS if each.name == "MDF 4")
    path = layout.make(tmp_path, OURS)
    with pytest.raises(UserError, match=r"name it a\.mf4"):
        read_recording(path.rename(tmp_path / "a.mdf"))
