"""Maps of masses as workshops and data sheets have them: columns, units, dialects, mistakes."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.desk.injection_map.mass_map import MassMap, read_map
from observer_rt.foundation.errors import UserError

DENSITY = 800.0
POINTS = [(30e6, 0.6e-3, 8e-6), (80e6, 0.6e-3, 18e-6), (120e6, 0.8e-3, 32.4e-6), (160e6, 0.3e-3, 9.6e-6)]


def map_of(text: str, folder: Path) -> MassMap:
    path = folder / "map.csv"
    path.write_text(text, encoding="utf-8")
    return read_map(path, DENSITY, 4)


@pytest.mark.parametrize(
    "text",
    [
        "rail_pressure_MPa,energizing_ms,mass_mg\n30,0.6,8\n80,0.6,18\n120,0.8,32.4\n160,0.3,9.6\n",
        "p [bar];Pulse [µs];Menge [mm³/Hub]\n300;600;10\n800;600;22,5\n1200;800;40,5\n1600;300;12\n",
        "injector,kind,rail_pressure_bar,energizing_us,quantity_mm3_per_stroke\n"
        "a,x,300,600,10\na,x,800,600,22.5\n\na,x,1200,800,40.5\na,x,1600,300,12\n",
        "# a bench\nPressure [MPa]\tET [ms]\tvolume [ul]\n30\t.6\t10\n80\t.6\t22.5\n120\t.8\t40.5\n160\t.3\t12\n",
    ],
)
def test_a_map_is_the_same_in_any_dialect(text: str, tmp_path: Path) -> None:
    read = map_of(text, tmp_path)
    np.testing.assert_allclose(np.column_stack((read.rail_pressure, read.energizing, read.mass)), POINTS, rtol=1e-12)
    assert read.back_pressure is None
    assert (read.sigma > 0.0).all()


def test_stated_uncertainties_count_as_what_they_are(tmp_path: Path) -> None:
    rows = "30,0.6,8,{0}\n80,0.6,18,{0}\n120,0.8,32.4,{0}\n160,0.3,9.6,{0}\n"
    by_percent = map_of("p_MPa,et_ms,mass_mg,sigma_percent\n" + rows.format(5), tmp_path)
    np.testing.assert_allclose(by_percent.sigma, 0.05 * by_percent.mass)
    by_tolerance = map_of("p_MPa,et_ms,mass_mg,tolerance [%]\n" + rows.format(10), tmp_path)
    np.testing.assert_allclose(by_tolerance.sigma, 0.05 * by_tolerance.mass)
    by_mass = map_of("p_MPa,et_ms,mass_mg,sigma_mg,back_pressure_bar\n" + rows.format("0.3,50"), tmp_path)
    np.testing.assert_allclose(by_mass.sigma, 0.3e-6)
    assert by_mass.back_pressure == pytest.approx(5e6)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("p_MPa,et_ms,mass_mg\n30,0.6,8\n80,0.6,\n120,0.8,32\n160,0.3,9\n", ("line 3", "'mass_mg'")),
        ("p_MPa,et_ms,mass_mg\n30,0.6,8\n80,0.6,9\n120,0.8,-2\n160,0.3,9\n", ("line 4", "'-2' mg")),
        ("p_MPa,et_ms,mass_mg\n30,0.6,8\n800,0.6,9\n120,0.8,2\n160,0.3,9\n", ("line 3", "'800' MPa")),
        ("p_MPa,et_ms,mass_mg\n30,0,8\n80,0.6,9\n120,0.8,2\n160,0.3,9\n", ("line 2", "energizing")),
        ("p,et_ms,mass_mg\n30,0.6,8\n80,0.6,9\n120,0.8,2\n160,0.3,9\n", ("line 1", "'p'", "no unit")),
        ("p_MPa,et_ms,other\n30,0.6,8\n80,0.6,9\n120,0.8,2\n160,0.3,9\n", ("line 1", "no heading names mass")),
        ("p_MPa,et_ms,mass_mg,volume_mm3\n30,0.6,8,9\n80,0.6,9,9\n120,0.8,2,9\n160,1,1,1\n", ("line 1", "several")),
        ("p_MPa,et_ms,mass_mg,back_pressure_MPa\n30,0.6,8,1\n80,0.6,9,5\n120,1,2,5\n160,1,1,1\n", ("several back",)),
        ("p_MPa,et_ms,mass_mg\n30,0.6,8\n80,0.6,9\n", ("holds 2 points",)),
        ("p_MPa,et_ms,mass_mg\n30,0.6,0\n80,0.6,0\n120,1,0\n160,1,0\n", ("no mass above 0",)),
    ],
)
def test_a_mistake_is_named_with_its_line(text: str, words: tuple[str, ...], tmp_path: Path) -> None:
    with pytest.raises(UserError) as refused:
        map_of(text, tmp_path)
    for word in words:
        assert word in str(refused.value)


ROWS = st.lists(st.tuples(st.integers(1, 3000), st.integers(50, 9000), st.integers(1, 20000)), min_size=4, max_size=9)


@given(points=ROWS, separator=st.sampled_from(";\t,"), decimal=st.sampled_from(".,"))
def test_numbers_come_back_as_written(
    tmp_path_factory: pytest.TempPathFactory, points: list[tuple[int, int, int]], separator: str, decimal: str
) -> None:
    if separator == decimal:
        return
    lines = [separator.join(("p_bar", "et_us", "mass_mg"))]
    for pressure, duration, mass in points:
        cells = (f"{pressure}.0", f"{duration}.0", f"{mass / 100:.2f}")
        lines.append(separator.join(cell.replace(".", decimal) for cell in cells))
    read = map_of("\n".join(lines), tmp_path_factory.mktemp("map"))
    numbers = np.column_stack((read.rail_pressure / 1e5, read.energizing / 1e-6, read.mass / 1e-8))
    np.testing.assert_allclose(numbers, points, rtol=1e-9)
