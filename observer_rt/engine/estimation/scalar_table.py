"""Table of the parameters of theta: a row for each kind of them, and the vectors that all rows make."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.belief import Gate
from observer_rt.model.effective import LAG_UNIT, LIFT_UNIT, Coefficients


class Element(Enum):
    """Elements of the model in whose laws the core has numbers that are learned."""

    NOZZLE = "nozzle"
    SENSOR = "sensor"
    VALVE = "valve"
    NEEDLE = "needle"


class ScalarUnit(Enum):
    """Unit of the numbers of a row."""

    AS_IT_IS = "-"
    PRESSURE = "Pa"  # theta counts in p_0
    TIME = "s"  # theta counts in `LAG_UNIT`
    LENGTH = "m"  # .. in `LIFT_UNIT`

    def unit(self, pressure_scale: float) -> float:
        """SI size of theta = 1; pressure_scale p_0 [Pa]."""
        units = (ScalarUnit.PRESSURE, pressure_scale), (ScalarUnit.TIME, LAG_UNIT), (ScalarUnit.LENGTH, LIFT_UNIT)
        return dict(units).get(self, 1.0)


@dataclass(frozen=True)
class ShownIndicator:
    """Indicator by which a parameter is reported."""

    effect: str  # id of the effect that it stands for, its name among indicators
    si: Callable[[Coefficients], float] = lambda _: 1.0  # size of theta = 1 in SI
    key: str = ""  # in JSON, unless that is the effect
    label: str = ""  # on the screen, beside the rate
    unit: tuple[str, float] = ("-", 1.0)  # with its size in SI
    screen_unit: tuple[str, float] | None = None  # likewise

    def factor(self, c: Coefficients, unit: tuple[str, float] | None = None) -> float:
        """Factor from theta to a unit, that of JSON unless another is given."""
        return self.si(c) / (unit or self.unit)[1]


@dataclass(frozen=True)
class Scalar:
    """Columns of theta of one kind, mostly one."""

    name: str
    column: int
    prior: float  # one sigma before any event
    drift: float  # one sigma from one event to the next
    longest_step: float  # of a Gauss-Newton iteration: beyond it the slopes say little
    bounds: tuple[float, float]  # lowest and highest admissible
    counted: ScalarUnit = ScalarUnit.AS_IT_IS  # unit of prior, drift, step and bounds
    gated_from: float | None = None  # lowest theta of a parameter that must pay for being active; None: it need not
    held: bool = False  # rest tells of it, no event
    columns: int = 1
    shown: ShownIndicator | None = None
    change: Callable[[Any, Any], Any] | None = None  # law: the line with it; None: neither line's nor guide's
    turn: int = 1  # laws act by rising turn, those of one turn in the order of the rows
    element: Element | None = None  # its law has the columns as its numbers, in the order of the rows


class Numbers(NamedTuple):
    """Columns of theta that are the numbers of an element's law, and SI sizes of theta = 1, of pressures in p_0."""

    columns: NDArray[np.int64]
    sizes: NDArray[np.float64]

    def of(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """The numbers in a parameter vector (m,)."""
        return np.asarray(theta[self.columns] * self.sizes)


@dataclass(frozen=True, eq=False)
class Scalars:
    """The table of all rows; its vectors (width,) are in the order of the columns."""

    rows: tuple[Scalar, ...]

    @cached_property
    def width(self) -> int:
        """Columns of theta."""
        return max(row.column + row.columns for row in self.rows)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the columns in files."""
        named = {
            row.column + i: row.name if row.columns == 1 else f"{row.name}_{i + 1}"
            for row in self.rows
            for i in range(row.columns)
        }
        return tuple(named[column] for column in range(self.width))

    @cached_property
    def laws(self) -> tuple[tuple[int, Callable[[Any, Any], Any]], ...]:
        """Columns and laws of line and guide, in the order in which they act."""
        rows = sorted(self.rows, key=attrgetter("turn"))
        return tuple((row.column, row.change) for row in rows if row.change is not None)

    def of_line(self, theta: NDArray[np.float64]) -> tuple[float, ...]:
        """Entries of theta (m,) that change line and guide, in the order of `laws`."""
        values = theta.tolist()
        return tuple([values[column] for column, _ in self.laws])

    def prior(self, pressure_scale: float) -> NDArray[np.float64]:
        """Standard deviations before any event; pressure_scale p_0 [Pa], as below."""
        return self._vector(attrgetter("prior"), pressure_scale)

    def drift(self, pressure_scale: float) -> NDArray[np.float64]:
        """Standard deviations of the change from event to event."""
        return self._vector(attrgetter("drift"), pressure_scale)

    def longest_step(self, pressure_scale: float) -> NDArray[np.float64]:
        """Longest steps of one iteration."""
        return self._vector(attrgetter("longest_step"), pressure_scale)

    def bounds(self, pressure_scale: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest admissible theta."""
        lowest = self._vector(lambda row: row.bounds[0], pressure_scale)
        return lowest, self._vector(lambda row: row.bounds[1], pressure_scale)

    @cached_property
    def gate(self) -> Gate:
        """Gate of the columns that must explain enough to be active."""
        lowest = {
            row.column + i: row.gated_from
            for row in sorted(self.rows, key=attrgetter("column"))
            if row.gated_from is not None
            for i in range(row.columns)
        }
        return Gate(lowest, held=tuple(row.column for row in self.rows if row.held))

    def shown(self) -> Iterator[tuple[int, ShownIndicator]]:
        """Column and appearance of the scalars shown."""
        return ((row.column, row.shown) for row in self.rows if row.shown is not None)

    def numbers(self, element: Element) -> Numbers:
        """Numbers of an element's law, in the order in which the core has them."""
        numbers = [(row.column + i, row) for row in self.rows if row.element is element for i in range(row.columns)]
        columns, rows = zip(*numbers, strict=True)
        return Numbers(np.array(columns), np.array([row.counted.unit(1.0) for row in rows]))

    def _vector(self, figure: Callable[[Scalar], float], pressure_scale: float) -> NDArray[np.float64]:
        result = np.zeros(self.width)
        for row in self.rows:
            result[row.column : row.column + row.columns] = figure(row) / row.counted.unit(pressure_scale)
        return result
