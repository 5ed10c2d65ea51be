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
@given(mean=MASSES, single=st.dictionaries(st.integers(1, 3), MASSES, max_size=3))
def test_masses_are_read_back(tmp_path: Path, mean: float, single: dict[int, float]) -> None:
    lines = [f"h_1.csv,,{mean},"] + [f"h_0.csv,{n},{mass},0.5" for n, mass in single.items() if mass > 0.5]
    path = _write(tmp_path, "recording,injection,mass_mg,sigma_mg\n" + "\n".join(lines) + "\n")
    read = read_masses(path, FOUND)
    assert read[1].mean == pytest.approx((mean * 1e-6, 0.005 * mean * 1e-6))
    firsts = [event.openings[0].first for event in FOUND[0].events]
    expected = {firsts[n - 1]: (mass * 1e-6, 0.5e-6) for n, mass in single.items() if mass > 0.5}
    result = read[0].single if 0 in read else {}
    assert result.keys() == expected.keys()
    for first, pair in expected.items():
        assert result[first] == pytest.approx(pair)


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
        ("", "is empty"),
        ("recording,mass_mg\n", "holds no mass"),
        ("recording,mass\nh_0.csv,3\n", "no column mass_mg"),
        ("recording,mass_mg,remark\nh_0.csv,3,x\n", "column 'remark' is unknown"),
        ("recording,mass_mg,mass_mg\nh_0.csv,3,3\n", "column 'mass_mg' is given twice"),
        ("recording,mass_mg\nother.csv,3\n", "line 2.*'other.csv' is none of the recordings"),
        ("recording,mass_mg\nh_0.csv,-3\n", "line 2, mass_mg.*'-3' is out of range"),
        ("recording,mass_mg\nh_0.csv,nan\n", "'nan' is out of range"),
        ("recording,mass_mg\nh_0.csv,3 mg\n", "'3 mg' is out of range"),
        ("recording,mass_mg\nh_0.csv,3\nh_0.csv,4\n", "line 3.*another line"),
        ("recording,mass_mg\nh_0.csv\n", "line 2.*1 cells, the header 2"),
        ("recording,injection,mass_mg\nh_0.csv,4,3\n", "line 2, injection.*'4' is none of them"),
        ("recording,injection,mass_mg\nh_0.csv,first,3\n", "'first' is none of them"),
        ("recording,mass_mg,sigma_mg\nh_0.csv,3,5\n", "sigma_mg.*'5' is out of range"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, problem: str) -> None:
    with pytest.raises(UserError, match=f"(?s){problem}"):
        read_masses(_write(tmp_path, text), FOUND)


def test_a_path_names_a_recording_too(tmp_path: Path) -> None:
    read = read_masses(_write(tmp_path, "recording,mass_mg\n/somewhere/h_1.csv,31.5\n"), FOUND)
    assert read[1].mean is not None


def test_a_table_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"absent\.csv"):
        read_masses(tmp_path / "absent.csv", FOUND)
