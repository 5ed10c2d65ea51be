"""The search for missing terms, on systems that have nothing to do with an injector."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from observer_rt.identification.discovery.search.term_fit import Each, TermFit
from observer_rt.identification.discovery.search.term_search import TermSearch, TermSearchResult
from observer_rt.identification.likelihood.bounded_fit import Range, Residuals

Floats = NDArray[np.float64]
PARTS = 8  # of the data, left out in turn


@dataclass(frozen=True)
class Term:
    """A coefficient in one equation; numbers: within its law."""

    equation: str
    range: Range
    numbers: int = 0


def in_turn(work: Callable[[int], object], items: Sequence[int]) -> Iterable[object]:
    return map(work, items)


def residuals_of(errors: Floats, sigma: float) -> Residuals:
    return Residuals(errors / sigma, np.full(PARTS, errors.size // PARTS), np.full(PARTS, np.log(sigma)))


class LibraryOnly:
    """No candidate but those given, without numbers of their own."""

    remainder = 0.0

    def tailored(self, about: TermFit, equations: Sequence[str], each: Each) -> Sequence[int]:
        return ()

    def tabulated(self, about: TermFit, each: Each) -> Sequence[int]:
        return ()

    def sharpened(self, chosen: Sequence[int], theta: Floats) -> tuple[int, ...] | None:
        return None


class Regression(LibraryOnly):
    """y = F theta + noise of 1: columns of F are candidates, named by their equations."""

    def __init__(self, equations: str, columns: Floats, y: Floats) -> None:
        self.candidates = tuple(Term(equation, Range(-10.0, 10.0, 0.01)) for equation in equations)
        self._columns, self._y = columns, y

    def residuals(self, chosen: Sequence[int], theta: Floats) -> Residuals:
        return residuals_of(self._y - self._columns[:, list(chosen)] @ theta, 1.0)

    def is_adequate(self, chosen: Sequence[int], theta: Floats) -> bool:
        return bool(np.mean(self.residuals(chosen, theta).z ** 2) < 1.2)


def searched(equations: str, columns: Sequence[Floats], signal: Floats, seed: int = 0) -> TermSearchResult:
    y = signal + np.random.default_rng(seed).normal(size=signal.size)
    return TermSearch(Regression(equations, np.column_stack(columns), y), in_turn).run()


def white(count: int, seed: int = 7) -> list[Floats]:
    return list(np.random.default_rng(seed).normal(size=(count, 800)))


@pytest.mark.parametrize("seed", range(5))
def test_noise_alone_proposes_nothing(seed: int) -> None:
    class NeverAdequate(Regression):
        def is_adequate(self, chosen: Sequence[int], theta: Floats) -> bool:
            return False

    noise = np.random.default_rng(seed).normal(size=800)
    problem = NeverAdequate("a" * 15 + "b" * 15, np.column_stack(white(30, seed + 100)), noise)
    result = TermSearch(problem, in_turn).run()
    assert result.best.chosen == ()
    assert not result.adequate


def test_two_terms_of_one_equation_are_found_that_alone_explain_next_to_nothing() -> None:
    common, difference, *others = white(6)
    nearly = common + 0.2 * difference
    result = searched("aabbbb", [common, nearly, *others], 5.0 * (nearly - common))
    assert set(result.best.chosen) == {0, 1}
    order = list(result.best.chosen)
    np.testing.assert_allclose(result.best.theta[np.argsort(order)], (-5.0, 5.0), atol=1.0)
    assert result.adequate


def test_a_term_that_later_ones_make_needless_is_dropped_and_its_place_used() -> None:
    *parts, weak, noise = white(4)
    whole = 2.0 * np.sum(parts, axis=0)
    result = searched("abcd", [whole + 3.0 * noise, *parts, weak], whole + 0.6 * weak)
    assert sorted(result.best.chosen) == [1, 2, 3]
    assert result.adequate


def test_what_was_found_wanting_before_is_no_answer_by_itself() -> None:
    """Only what comes to it: here a law alone leaves little, and the pair that was known explains even that."""
    law, beside = white(2)
    pair = law + beside, law - beside
    y = 2.6 * pair[0] + 2.4 * pair[1] + np.random.default_rng(0).normal(size=law.size)
    problem = Regression("abc", np.column_stack((law, *pair)), y)
    result = TermSearch(problem, in_turn).run([((1, 2), np.array([2.6, 2.4]))])
    assert result.adequate
    assert result.best.chosen == (0,)


def test_what_may_be_the_own_error_of_a_model_is_no_term() -> None:
    class Fitted(Regression):
        remainder = 0.06

    cause, error = white(2)
    y = 5.0 * cause + error + np.random.default_rng(0).normal(size=cause.size)
    for kind, count in ((Regression, 2), (Fitted, 1)):
        best = TermSearch(kind("ab", np.column_stack((cause, error)), y), in_turn).run().best
        assert len(best.chosen) == count


@pytest.mark.parametrize("size", [0.5, 3.0, 300.0, 5000.0])
def test_a_term_is_found_however_large_it_is_against_the_noise(size: float) -> None:
    """What it gains counts linearly beyond some sigma, and so does what it must gain."""
    cause, *others = white(4)

    class Wide(Regression):
        def __init__(self, equations: str, columns: Floats, y: Floats) -> None:
            super().__init__(equations, columns, y)
            self.candidates = tuple(Term(equation, Range(-1e4, 1e4, 0.01)) for equation in equations)

    y = size * cause + np.random.default_rng(0).normal(size=cause.size)
    result = TermSearch(Wide("abcd", np.column_stack((cause, *others)), y), in_turn).run()
    assert result.best.chosen == (0,)
    assert result.adequate


@pytest.mark.parametrize("unlike", [0.01, 0.3])
def test_a_term_beyond_its_bounds_is_not_taken_twice(unlike: float) -> None:
    cause, other = white(2)
    twin = cause + unlike * other
    result = searched("aab", [cause, twin, other], 15.0 * cause)
    assert result.best.chosen in {(0,), (1,)}
    np.testing.assert_allclose(result.best.theta, 10.0)
    assert not result.adequate


def test_a_rival_of_another_equation_is_listed() -> None:
    cause, other, noise = white(3)
    result = searched("aabc", [cause, 0.999 * cause, cause + 0.01 * noise, other], 2.0 * cause)
    assert len(result.best.chosen) == 1
    found = {"aabc"[number] for fit in (result.best, *result.rivals) for number in fit.chosen}
    assert found == {"a", "b"}
    assert len(result.rivals) == 1


def bump(u: Floats, place: float) -> Floats:
    return np.exp(-(((u - place) / 0.2) ** 2))


class Bumps(Regression):
    """Candidates in two equations; another, a bump over u, is made for what is left, and moved until it fits."""

    def __init__(self, u: Floats, y: Floats) -> None:
        super().__init__("ab", np.column_stack((u, u**2)), y)
        self._u = u

    def tailored(self, about: TermFit, equations: Sequence[str], each: Each) -> Sequence[int]:
        assert set(equations) <= {"a", "b"}
        return [self._with(0.5, "b")] if not about.chosen else []

    def sharpened(self, chosen: Sequence[int], theta: Floats) -> tuple[int, ...] | None:
        if chosen[-1] < 2:
            return None
        left = self._y - self._columns[:, chosen[:-1]] @ theta[:-1]
        best = least_squares(lambda p: p[0] * bump(self._u, p[1]) - left, (theta[-1], 0.5))
        return (*chosen[:-1], self._with(best.x[1], "b"))

    def _with(self, place: float, equation: str) -> int:
        self._columns = np.column_stack((self._columns, bump(self._u, place)))
        self.candidates = (*self.candidates, Term(equation, Range(-10.0, 10.0, 0.01)))
        return len(self.candidates) - 1


def test_a_term_made_for_what_is_left_is_taken_at_its_sharpest() -> None:
    u = np.linspace(0.0, 1.0, 800)
    y = 3.0 * bump(u, 0.62) + np.random.default_rng(3).normal(size=800)
    problem = Bumps(u, y)
    best = TermSearch(problem, in_turn).run().best
    assert len(best.chosen) == 1
    np.testing.assert_allclose(problem._columns[:, best.chosen[0]], bump(u, 0.62), atol=0.2)
    assert best.theta[0] == pytest.approx(3.0, abs=0.3)


def test_a_term_is_made_even_where_no_candidate_says_anything() -> None:
    u = np.linspace(0.0, 1.0, 800)
    problem = Bumps(u, 3.0 * bump(u, 0.5) + np.random.default_rng(3).normal(size=800))
    problem._columns[:, :2] = 0.0
    assert len(TermSearch(problem, in_turn).run().best.chosen) == 1
