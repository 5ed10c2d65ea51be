"""What a search for terms needs to know of a system, and its fits.

A system, its candidates and its data come in as a `TermProblem`: no injector is known here.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from observer_rt.identification.likelihood.bounded_fit import Range, Residuals

PRICE = 10.0  # of -2 log L for a term more, which of two near-ties leads
MOST_NAMED = 3  # numbers within a law that has a name: a table has more
Each = Callable[[Callable[[int], object], Sequence[int]], Iterable[object]]
"""Applies work to items, on several threads if it likes, in the order of the items."""


class CandidateTerm(Protocol):
    """A term that may be missing; its coefficient is the only free number."""

    @property
    def equation(self) -> str:
        """The equation it corrects."""

    @property
    def range(self) -> Range:
        """Bounds of its coefficient, and a small one."""

    @property
    def numbers(self) -> int:
        """How many numbers within its law were fitted."""


class TermProblem(Protocol):
    """A system with candidates, and its data."""

    @property
    def candidates(self) -> Sequence[CandidateTerm]:
        """Terms that may be missing."""

    @property
    def remainder(self) -> float:
        """Share of what terms explain that may be the model's own error; 0 of an exact one."""

    def residuals(self, chosen: Sequence[int], theta: NDArray[np.float64]) -> Residuals | None:
        """Residuals with these candidates in force, their coefficients theta; None without a solution."""

    def is_adequate(self, chosen: Sequence[int], theta: NDArray[np.float64]) -> bool:
        """Whether nothing but noise is left."""

    def tailored(self, about: "TermFit", equations: Sequence[str], each: Each) -> Sequence[int]:
        """Candidates made for what a fit leaves, which may be new; equations: the most promising first."""

    def tabulated(self, about: "TermFit", each: Each) -> Sequence[int]:
        """Candidates whose laws are free curves, which may be new, for what a fit leaves."""

    def sharpened(self, chosen: Sequence[int], theta: NDArray[np.float64]) -> tuple[int, ...] | None:
        """These terms with the numbers within their laws fitted; None where they have none. They may be new."""


@dataclass(frozen=True, eq=False)
class TermFit:
    """Terms fitted together: numbers of the candidates, their coefficients with standard deviations, what is left.

    within: how many numbers within the laws of each were fitted before.
    """

    chosen: tuple[int, ...]
    theta: NDArray[np.float64]
    sigmas: NDArray[np.float64]
    residuals: Residuals
    within: tuple[int, ...] = ()

    @property
    def statistic(self) -> float:
        """-2 log L."""
        return self.residuals.statistic

    @property
    def spread(self) -> float:
        """Mean square of the normalised residuals as `statistic` counts it, 1 at least."""
        return max(1.0, self.residuals.squares / self.residuals.z.size)

    @property
    def price(self) -> float:
        """-2 log L, and what every number fitted costs."""
        return self.statistic + PRICE * (len(self.chosen) + sum(self.within)) * self.spread

    @property
    def by_table(self) -> bool:
        """Whether a law is a table."""
        return max(self.within, default=0) > MOST_NAMED


def no_terms(problem: TermProblem) -> TermFit:
    """The model as it is. Raises ArithmeticError where it has no solution."""
    here = problem.residuals((), np.zeros(0))
    if here is None:
        raise ArithmeticError("the model has no finite solution on these recordings")
    return TermFit((), np.zeros(0), np.zeros(0), here)
