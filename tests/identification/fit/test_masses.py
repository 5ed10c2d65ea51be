"""Tables of measured masses: read back, or refused with file and line."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from observer_rt.foundation.errors import UserError
from observer_rt.identification.fit.masses import MEAN, read_masses
from observer_rt.identification.likelihood.measurement import measurements
from tests.identification.fit.healthy import simulations

MADE = enumerate(simulations([(60e6, 0.6e-3), (100e6, 0.6e-3)]))
FOUND = measurements([replace(one.recording, path=Path(f"/somewhere/h_{number}.csv")) for number, one in MADE])
DENSITY = 750.0
MASSES = st.floats(0.1, 500.0).map(lambda value: round(value, 4))
SAME_FILE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


def _write(folder: Path, text: str) -> Path:
    path = folder / "masses.csv"
    path.write_text(text, encoding="utf-8")
    return path


@SAME_FILE
@given(
    mass=MASSES,
    column=st.sampled_from(["", "sigma_mg", "sigma_percent"]),
    name=st.sampled_from(["h_1.csv", "/somewhere/h_1.csv"]),
    german=st.booleans(),
)
def test_masses_are_read_back(tmp_path: Path, mass: float, column: str, name: str, german: bool) -> None:
    header = f" {column}, recording, mass_mg" if column else "recording,mass_mg"
    row = f"0.1, {name}, {mass}" if column else f"{name},{mass}"
    text = f"{header}\n\n{row}\n"
    if german:
        text = text.replace(",", ";").replace(f"{mass}", f"{mass}".replace(".", ","))
    read = read_masses(_write(tmp_path, text), FOUND, DENSITY)
    sigma = {"": 0.005 * mass, "sigma_mg": 0.1, "sigma_percent": 0.001 * mass}[column]
    assert read == {1: {MEAN: pytest.approx((1e-6 * mass, 1e-6 * sigma))}}


@SAME_FILE
@given(masses=st.dictionaries(st.integers(1, 3), MASSES, min_size=1), mean=MASSES, excel=st.booleans())
def test_masses_of_injections_are_read(tmp_path: Path, masses: dict[int, float], mean: float, excel: bool) -> None:
    rows = [f"{mass},h_1.csv,{number}" for number, mass in masses.items()]
    text = "\n".join(["mass_mg,recording,injection", *rows, f"{mean},h_0.csv,", ""])
    if excel:
        text = "sep=;\n" + text.replace(",", ";").replace(".", ",").replace(",csv", ".csv")
    read = read_masses(_write(tmp_path, text), FOUND, DENSITY)
    assert {number: 1e6 * mass.mass for number, mass in read[1].items()} == pytest.approx(masses)
    assert read[0] == {MEAN: pytest.approx((1e-6 * mean, 5e-9 * mean))}


@SAME_FILE
@given(st.text(max_size=200))
def test_any_text_is_read_or_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "masses.csv"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(UserError, match=r"masses\.csv"):
        read_masses(path, FOUND, DENSITY)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "line 1.*recording,mass_mg"),
        ("recording,mass_mg\n", "holds no mass"),
        ("recording,mass_mg,remark\nh_0.csv,3,x\n", "line 1.*remark.*recording,mass_mg"),
        ("recording,mass_mg,mass_mg\nh_0.csv,3,3\n", "line 1.*mass_mg, mass_mg"),
        ("recording,mass_mg,rate_file\nh_0.csv,3,x\n", "line 1.*rate_file"),
        ("recording,rate_file\nh_0.csv,tube.txt\n", r"tube\.txt"),
        ("recording,mass_mg\nother.csv,3\n", "line 2.*'other.csv' is none of the recordings"),
        ("recording,mass_mg\nh_0.csv,-3\n", "line 2, mass_mg.*'-3' is out of range"),
        ("recording,mass_mg\nh_0.csv,nan\n", "'nan' is out of range"),
        ("recording,mass_mg\nh_0.csv,3\nh_0.csv,4\n", "line 3.*another line"),
        ("recording,mass_mg,injection\nh_0.csv,3,1\nh_0.csv,4,1\n", "line 3.*another line.*each injection once"),
        ("recording,mass_mg,injection\nh_0.csv,3,1\nh_0.csv,4,\n", "line 3.*another line.*no mean"),
        ("recording,mass_mg,injection\nh_0.csv,3,\nh_0.csv,4,1\n", "line 3.*another line.*no mean"),
        (
            "recording,mass_mg,injection\nh_0.csv,3,4\n",
            "line 2, injection.*'4' is no injection of h_0.csv, which has 3",
        ),
        ("sep=;\nrecording;remark\nh_0.csv;3\n", "line 2.*remark"),
        ("sep=;\nrecording;mass_mg\nh_0.csv;-3\n", "line 3, mass_mg"),
        ("recording,mass_mg\nh_0.csv\n", "line 2.*1 cells, the header 2"),
        ("recording,mass_mg,sigma_mg\nh_0.csv,3,5\n", "sigma_mg.*'5' is out of range"),
        ("recording,mass_mg,sigma_percent\nh_0.csv,3,0\n", "sigma_percent.*'0' is out of range.*give % above 0"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, problem: str) -> None:
    with pytest.raises(UserError, match=f"(?s){problem}"):
        read_masses(_write(tmp_path, text), FOUND, DENSITY)


def test_a_table_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"absent\.csv"):
        read_masses(tmp_path / "absent.csv", FOUND, DENSITY)


UNITS = {"mg/ms": 1e-3, "g/s": 1e-3, "kg/s": 1.0, "mg/s": 1e-6}
UNITS |= {unit: DENSITY * si for unit, si in (("mm3/ms", 1e-6), ("cm³/s", 1e-6), ("l/min", 1e-3 / 60))}


def _by_tube(folder: Path, text: str, names: str = "") -> float:
    (folder / "tube.txt").write_text(text, encoding="utf-8")
    table = (
        f"recording,rate_file,names\nh_1.csv,tube.txt,{names}\n"
        if names
        else "recording,rate_file,injection\nh_1.csv,tube.txt,2\n"
    )
    return read_masses(_write(folder, table), FOUND, DENSITY)[1][MEAN if names else 2].mass


@SAME_FILE
@given(
    unit=st.sampled_from(sorted(UNITS)),
    separator=st.sampled_from(["\t", ";", " ", ", "]),
    mark=st.sampled_from(["# ", "#", "#\t", ""]),
    names=st.sampled_from([("Time", "Mass flow rate"), ("Zeit", "Einspritzrate"), ("t", "dm/dt")]),
    rates=st.lists(st.floats(0.1, 20.0).map(lambda value: round(value, 3)), min_size=3, max_size=9),
)
def test_a_rate_meters_table_gives_its_integral(
    tmp_path: Path, unit: str, separator: str, mark: str, names: tuple[str, str], rates: list[float]
) -> None:
    rows = [f"{0.01 * number:.2f}{separator}{rate}" for number, rate in enumerate(rates)]
    text = "\n".join(["# Bosch tube, 2 shots", f"{mark}{names[0]} [ms]{separator}{names[1]} [{unit}]", *rows, ""])
    assert _by_tube(tmp_path, text) == pytest.approx(1e-5 * UNITS[unit] * (sum(rates) - (rates[0] + rates[-1]) / 2))


@pytest.mark.parametrize("text", ["0\t3\n1\t3\n", "inflow table\n(\n    (0 3)\n    (1 3)\n);\n"])  # of OpenFOAM
def test_a_meters_table_without_names_is_named_in_that_of_the_masses(tmp_path: Path, text: str) -> None:
    assert _by_tube(tmp_path, text, "t [ms] mass flow rate [g/s]") == pytest.approx(3e-6)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("0.0\t1.0\n0.1\t1.0\n", "tube.txt.*has no names above its numbers.*recording,rate_file,names"),
        ("# time [ms], rate [mg/ms]\n0,1\n1,1\n30,1\n31,0\n", "holds 2 injections, the last at 0.03 s"),
        ("# time [ms], rate\n0.0,1.0\n0.1,1.0\n", r"line 1: injection_rate: 'rate' has no unit.*rate \[mg/ms\]"),
        ("# time [ms], rate [mg/ms]\n0.0,1.0\n0.1,x\n", "line 3: column rate.*'x' is not a number"),
        ("# time [ms], rate [mg/ms]\n0.1,1.0\n0.0,1.0\n", "line 3: the time does not rise"),
        ("# time [ms], rate [mg/ms]\n0.1,1.0\n", "line 2: holds one row only"),
    ],
)
def test_mistakes_of_a_rate_meters_table_are_named(tmp_path: Path, text: str, problem: str) -> None:
    with pytest.raises(UserError, match=f"(?s){problem}"):
        _by_tube(tmp_path, text)
