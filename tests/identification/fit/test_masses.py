"""Tables of measured masses: read back, or refused with file and line."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from observer_rt.foundation.errors import UserError
from observer_rt.identification.fit.masses import read_masses
from observer_rt.identification.likelihood.measurement import measurements
from tests.identification.fit.healthy import simulations

FOUND = measurements(
    [
        one.recording.__class__(**{**vars(one.recording), "path": Path(f"/somewhere/h_{number}.csv")})
        for number, one in enumerate(simulations([(60e6, 0.6e-3), (100e6, 0.6e-3)]))
    ]
)
MASSES = st.floats(0.1, 500.0).map(lambda value: round(value, 4))
SAME_FILE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


def _write(folder: Path, text: str) -> Path:
    path = folder / "masses.csv"
    path.write_text(text, encoding="utf-8")
    return path


@SAME_FILE
@given(mass=MASSES, sigma=st.none() | st.just(0.1))
def test_masses_are_read_back(tmp_path: Path, mass: float, sigma: float | None) -> None:
    header = "recording,mass_mg" if sigma is None else " sigma_mg, recording, mass_mg"
    row = f"h_1.csv,{mass}" if sigma is None else f"{sigma}, h_1.csv, {mass}"
    read = read_masses(_write(tmp_path, f"{header}\n\n{row}\n"), FOUND)
    expected = 1e-6 * mass, 1e-6 * (0.005 * mass if sigma is None else sigma)
    assert read == {1: pytest.approx(expected)}


@SAME_FILE
@given(st.text(max_size=200))
def test_any_text_is_read_or_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "masses.csv"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(UserError, match=r"masses\.csv"):
        read_masses(path, FOUND)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "line 1.*recording,mass_mg"),
        ("recording,mass_mg\n", "holds no mass"),
        ("recording,mass\nh_0.csv,3\n", "line 1.*recording, mass'.*recording,mass_mg"),
        ("recording,mass_mg,remark\nh_0.csv,3,x\n", "line 1.*remark.*recording,mass_mg"),
        ("recording,mass_mg,mass_mg\nh_0.csv,3,3\n", "line 1.*mass_mg, mass_mg"),
        ("recording,mass_mg\nother.csv,3\n", "line 2.*'other.csv' is none of the recordings"),
        ("recording,mass_mg\nh_0.csv,-3\n", "line 2, mass_mg.*'-3' is out of range"),
        ("recording,mass_mg\nh_0.csv,nan\n", "'nan' is out of range"),
        ("recording,mass_mg\nh_0.csv,3 mg\n", "'3 mg' is out of range"),
        ("recording,mass_mg\nh_0.csv,3\nh_0.csv,4\n", "line 3.*another line"),
        ("recording,mass_mg\nh_0.csv\n", "line 2.*1 cells, the header 2"),
        ("recording,mass_mg,sigma_mg\nh_0.csv,3,5\n", "sigma_mg.*'5' is out of range"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, problem: str) -> None:
    with pytest.raises(UserError, match=f"(?s){problem}"):
        read_masses(_write(tmp_path, text), FOUND)


def test_a_path_names_a_recording_too(tmp_path: Path) -> None:
    read = read_masses(_write(tmp_path, "recording,mass_mg\n/somewhere/h_1.csv,31.5\n"), FOUND)
    assert read[1].mass == pytest.approx(31.5e-6)


def test_a_table_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"absent\.csv"):
        read_masses(tmp_path / "absent.csv", FOUND)
