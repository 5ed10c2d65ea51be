"""Values as people read them."""

import pytest

from observer_rt.identification.discovery.report.numbers import shown
from observer_rt.identification.discovery.report.text import printed
from observer_rt.identification.discovery.search.results import FittedParameter


@pytest.mark.parametrize(
    ("effect", "value", "ci95", "text"),
    [
        ("orifice_area", 0.30123, (0.29533, 0.30713), "v_H = 0.3012 (95 %: 0.2953 to 0.3071)"),
        ("lift_offset", 20.27e-6, (20.14e-6, 20.40e-6), "x_0 = 20.27 µm (95 %: 20.14 to 20.40 µm)"),
        ("chamber_pressure_rise", 4.2e6, (3.1e6, 5.3e6), "dp = 4.2 MPa (95 %: 3.1 to 5.3 MPa)"),
        (
            "guide_leakage",
            6.2272e-14,
            (6.0662e-14, 6.3882e-14),
            "c = 6.23e-14 m³/(s Pa) (95 %: 6.07e-14 to 6.39e-14 m³/(s Pa))",
        ),
    ],
)
def test_digits_are_those_the_interval_deserves(
    effect: str, value: float, ci95: tuple[float, float], text: str
) -> None:
    name = text.split(" ", 1)[0]
    size = printed(effect, [FittedParameter(name, value, ci95)])[name]
    assert f"{name} = {size.value_text} (95 %: {size.interval_text})" == text


def test_an_exact_value_is_shown_as_it_is() -> None:
    assert shown(0.25, 0.0) == "0.25"


def test_values_are_in_the_unit_of_the_vocabulary() -> None:
    found = printed("line_pressure_sensor_lag", [FittedParameter("tau", 25e-6, (24e-6, 26e-6))])["tau"]
    assert (found.value, found.ci95, found.unit) == (25.0, (24.0, 26.0), "us")
