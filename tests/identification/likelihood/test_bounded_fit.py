"""Bounded maximum likelihood by finite differences."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.identification.likelihood.bounded_fit import Minimum, Range, Residuals, fit, sigmas_of

N = 4000
RNG = np.random.default_rng(5)
NOISE = RNG.normal(size=N)
REGRESSORS = RNG.normal(size=(N, 2))


def _residuals(z: NDArray[np.float64], log_sigma: float = 0.0) -> Residuals:
    return Residuals(z, np.array([z.size]), np.array([log_sigma]))


def _line(theta: NDArray[np.float64]) -> Residuals:
    return _residuals(NOISE + REGRESSORS @ (theta - np.array([2.0, -1.0])))


WIDE = (Range(-50.0, 50.0, 1e-4), Range(-50.0, 50.0, 1e-4))


def _minimum(result: Minimum | None) -> Minimum:
    assert result is not None
    return result


def test_a_linear_problem_is_solved_as_by_least_squares() -> None:
    expected = np.linalg.lstsq(REGRESSORS, REGRESSORS @ [2.0, -1.0] - NOISE, rcond=None)[0]
    minimum = _minimum(fit(_line, np.zeros(2), WIDE))
    assert minimum.at.theta == pytest.approx(expected, abs=2e-3)
    covariance = np.linalg.inv(REGRESSORS.T @ REGRESSORS)
    assert minimum.sigmas() == pytest.approx(np.sqrt(np.diag(covariance)), rel=0.01)


def test_a_bound_holds_and_the_other_parameter_is_fitted_beside_it() -> None:
    minimum = _minimum(fit(_line, np.zeros(2), (Range(-50.0, 1.0, 1e-4), WIDE[1])))
    remaining = REGRESSORS @ [2.0, -1.0] - NOISE - REGRESSORS[:, 0]
    (expected,) = np.linalg.lstsq(REGRESSORS[:, 1:], remaining, rcond=None)[0]
    assert minimum.at.theta == pytest.approx([1.0, expected], abs=2e-3)


def test_a_spread_is_a_parameter_as_any_other() -> None:
    data = 3.0 * NOISE

    def spread(theta: NDArray[np.float64]) -> Residuals:
        return _residuals(data / np.exp(theta[0]), float(theta[0]))

    minimum = _minimum(fit(spread, np.zeros(1), (Range(-5.0, 5.0, 1e-5),)))
    assert np.exp(minimum.at.theta[0]) == pytest.approx(np.sqrt(np.mean(data**2)), rel=2e-3)
    assert minimum.sigmas()[0] == pytest.approx(1.0 / np.sqrt(2.0 * N), rel=0.03)


def test_outliers_move_the_result_little() -> None:
    spiked = NOISE.copy()
    spiked[::100] += 60.0

    def level(theta: NDArray[np.float64]) -> Residuals:
        return _residuals(spiked - theta[0])

    minimum = _minimum(fit(level, np.array([5.0]), (Range(-9.0, 9.0, 1e-4),)))
    assert abs(minimum.at.theta[0] - NOISE.mean()) < 0.06  # the mean moves by 0.6


def test_a_curved_problem_is_solved_from_afar() -> None:
    time = np.linspace(0.0, 1.0, N)

    def decay(theta: NDArray[np.float64]) -> Residuals:
        return _residuals(NOISE + 50.0 * (np.exp(-3.0 * time) - np.exp(-theta[0] * time)))

    minimum = _minimum(fit(decay, np.array([30.0]), (Range(0.0, 100.0, 1e-5),)))
    assert minimum.at.theta[0] == pytest.approx(3.0, abs=4 * minimum.sigmas()[0])


def test_what_the_data_do_not_see_has_no_limit() -> None:
    """A parameter that nothing shows, and two that do the same: the others are as sure as without them."""

    def blind(theta: NDArray[np.float64]) -> Residuals:
        alike = REGRESSORS[:, 1] * (1.0 + theta[2]) * (1.0 + theta[3])
        return _residuals(NOISE - theta[0] * REGRESSORS[:, 0] - alike)

    minimum = _minimum(fit(blind, np.array([1.0, 7.0, 0.1, 0.2]), (*WIDE, *WIDE)))
    assert minimum.at.theta[1] == 7.0
    assert np.isinf(minimum.sigmas()[1:]).all()
    assert minimum.sigmas()[0] == pytest.approx(1.0 / np.linalg.norm(REGRESSORS[:, 0]), rel=0.01)
    assert np.isinf(sigmas_of(np.ones((2, 2)))).all()


def test_steps_into_the_insoluble_are_shortened() -> None:
    def fragile(theta: NDArray[np.float64]) -> Residuals | None:
        return None if theta[0] > 2.5 else _residuals(NOISE + 0.01 * (theta[0] - 2.0) ** 3 + theta[0] - 2.0)

    minimum = _minimum(fit(fragile, np.array([-20.0]), (Range(-50.0, 50.0, 1e-5),)))
    assert minimum.at.theta[0] == pytest.approx(2.0, abs=0.1)
    assert fit(fragile, np.array([3.0]), (Range(-50.0, 50.0, 1e-5),)) is None


def test_a_bound_on_the_way_does_not_end_the_search() -> None:
    """Two parameters almost alike: the undamped step runs into a bound of one of them and leads uphill."""
    nearly = REGRESSORS @ np.array([[1.0, 0.999], [0.0, 0.05]])
    ranges = Range(-50.0, 50.0, 1e-4), Range(0.9, 2.0, 1e-4)
    fitted = fit(lambda theta: _residuals(NOISE + nearly @ (theta - [4.0, 1.0])), np.array([1.2, 1.5]), ranges)
    minimum = _minimum(fitted)
    assert minimum.statistic < _residuals(NOISE).statistic + 0.1


def test_slopes_at_the_minimum_are_not_had_before_they_are_wanted() -> None:
    asked: list[NDArray[np.float64]] = []

    def noted(theta: NDArray[np.float64]) -> Residuals:
        asked.append(theta)
        return _line(theta)

    start = np.zeros(2)
    minimum = _minimum(fit(noted, start, WIDE, 1, _line(start)))
    assert len(asked) == 3  # two slopes at the start, where the residuals are known, and the step
    assert np.array_equal(asked[-1], minimum.theta)
    assert np.isfinite(minimum.sigmas()).all()
    assert len(asked) == 5


def test_residuals_known_at_a_start_out_of_bounds_are_not_those_within() -> None:
    bounds = (Range(0.0, 5.0, 1e-4), Range(-5.0, 5.0, 1e-4))
    start = np.array([-9.0, 0.0])
    minimum = _minimum(fit(_line, start, bounds, 0, _line(start)))
    assert np.array_equal(minimum.residuals.z, _line(np.zeros(2)).z)
