"""Laws made to measure: a static regression on random moments, whose candidates are terms."""

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.identification.discovery.search import curves
from observer_rt.identification.discovery.search.candidates import equation_of
from observer_rt.identification.discovery.search.scores import Scores, scored
from observer_rt.identification.likelihood.bounded_fit import Residuals
from observer_rt.model.effect import Effect
from observer_rt.model.term_effect import TermLaw, form_freed, form_settled, term_of
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import TermEquation
from tests.model.terms.laws import moments

COUNT, SIGMA = 4000, 0.1
VALUES = moments(1, COUNT) | {"closing": np.tile([0.0, 1.0], COUNT // 2)}


def measured(law: str) -> NDArray[np.float64]:
    noise = np.random.default_rng(5).normal(size=COUNT)
    return parse(law).at(VALUES) + SIGMA * noise


def scoring(left: NDArray[np.float64]) -> curves.Score:
    """Scores of terms in the residuals of a regression (COUNT,): each is its law at random moments."""
    here = Residuals(left / SIGMA, np.array([COUNT]), np.array([np.log(SIGMA)]))
    weights = here.roots

    def score(effects: Sequence[Effect]) -> Scores:
        laws = [term.law.at(VALUES) for one in effects if (term := term_of(one, 1.0)) is not None]
        rows = [np.asarray(weights * law / SIGMA, np.float32) for law in laws]
        usable = np.array([number for number, row in enumerate(rows) if row.any()], np.int64)
        slopes = np.column_stack([rows[number] for number in usable])
        return scored([effects[number] for number in usable], usable, slopes, here)

    return score


def made(law: str, *equations: TermEquation) -> list[Effect]:
    score, swings = scoring(measured(law)), curves.waves([1200.0], 0.04)
    every = [curves.Curve(equation, *one) for equation in equations for one in curves.CURVES[equation]]
    return curves.made_to_measure(curves.free_curves(every, score), swings, score)


@pytest.mark.parametrize(
    ("law", "equation", "form", "numbers"),
    [
        ("0.3 * exp(-((needle_lift/max_lift - 0.5)/0.2)^2)", TermEquation.SEAT_FLOW, "exp(-((", (0.5, 0.2)),
        ("-0.3 * (time_since_opening > 0.6)", TermEquation.NOZZLE_FLOW, "(1 + tanh((", (0.6, 0.04)),
        ("0.4 * closing * max(0.4 - needle_lift/max_lift, 0)", TermEquation.SEAT_FLOW, "closing*max(A - ", (0.4,)),
        (
            "3 * exp(-time_since_opening/0.6) * sin(6.283185307 * 1.5 * time_since_opening)",
            TermEquation.CHAMBER_PRESSURE,
            "exp(-(time_since_opening/1)/A)*sin(",
            (1.0, 1.5, 0.0),
        ),
    ],
)
def test_the_form_nearest_to_a_free_curve_leads(
    law: str, equation: TermEquation, form: str, numbers: tuple[float, ...]
) -> None:
    best = made(law, TermEquation.LINE_FLOW, equation)[0].apply
    assert isinstance(best, TermLaw)
    assert best.equation is equation
    assert best.form.startswith(form)
    np.testing.assert_allclose([one.value for one in best.numbers], numbers, atol=0.31)


def test_a_wave_is_turned_to_its_phase() -> None:
    best = made("2 * sin(6.283185307 * 1200[Hz] * time + 1)", TermEquation.LINE_FLOW)[0].apply
    assert isinstance(best, TermLaw)
    frequency, phase = best.numbers
    assert frequency.value == 1200.0
    assert phase.value == pytest.approx(1.0, abs=0.05)


def test_numbers_within_a_law_are_freed_and_settled() -> None:
    effect = made("0.3 * exp(-((needle_lift/max_lift - 0.5)/0.2)^2)", TermEquation.SEAT_FLOW)[0]
    freed = form_freed(effect)
    assert [one.name for one in freed.parameters] == ["c", "A", "W"]
    settled = form_settled(effect, (0.512345, 0.187654)).apply
    assert isinstance(settled, TermLaw)
    assert str(settled.law) == "c * exp(-((needle_lift / max_lift - 0.512) / 0.1877)^2)"


def test_lines_stand_out_of_noise() -> None:
    noise = np.random.default_rng(2)
    times = [np.asarray(start + 1e-5 * np.arange(6000), np.float64) for start in (0.0, 0.04)]
    swings = [0.5 * np.sin(2.0 * np.pi * 2791.0 * one + 0.4) for one in times]
    left = [swing + noise.normal(size=swing.size) for swing in swings]
    assert curves.lines(left, times, 1e-5)[0] == pytest.approx(2791.0, abs=3.0)
    assert curves.lines([noise.normal(size=6000) for _ in range(8)], 4 * times, 1e-5) == []


def test_a_hum_is_of_rail_chamber_or_sensor_never_an_outflow() -> None:
    where = {equation_of(one) for pair in curves.waves([1200.0], 0.04) for one in pair}
    assert where == {"rail_pressure", "chamber_pressure", "line_pressure_sensor"}
