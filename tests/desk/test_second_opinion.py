"""The learning observer asked about the recordings of a discovery."""

import pytest

from observer_rt.desk.second_opinion import second_opinion
from observer_rt.identification.discovery.findings import stands_out
from observer_rt.model.effects import sized
from tests.identification.discovery.hidden import NOMINAL, recordings

POINTS = ((60e6, 1.0e-3), (100e6, 1.5e-3), (140e6, 1.0e-3))


def test_wear_shows_in_its_own_indicator() -> None:
    opinion = second_opinion(NOMINAL, recordings((sized("orifice_area", v_H=0.15),), points=POINTS))
    assert opinion is not None
    wear = opinion.indicators["orifice_area"]
    assert wear.sigma is not None
    assert wear.value == pytest.approx(0.15, abs=5 * wear.sigma)
    assert [name for name, one in opinion.indicators.items() if stands_out(name, one)] == ["orifice_area"]
    assert opinion.injections == 6
    assert (
        opinion.valid == 3
    )  # all but the two of a start, and the first at a higher rail pressure than those
    assert opinion.reasons == {}


def test_an_offset_is_in_megapascal() -> None:
    opinion = second_opinion(
        NOMINAL, recordings((sized("line_pressure_sensor_offset", o=0.3e6),), points=POINTS)
    )
    assert opinion is not None
    assert opinion.indicators["line_pressure_sensor_offset"].value == pytest.approx(0.3, rel=0.05)
