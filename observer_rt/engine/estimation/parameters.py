"""Parameters theta: a row of the table for each kind of them, what they mean, and the gate that some must pass."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, IntEnum
from functools import cached_property, lru_cache
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from observer_rt.core.model.model import FIRST_OF_SEAT, SENSOR_NUMBERS
from observer_rt.core.model.needle import NEEDLE_NUMBERS
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MICROSECOND, MM3_PER_MS, Floats, Ints
from observer_rt.model import network
from observer_rt.model.effective import LAG_UNIT, LIFT_UNIT, Coefficients
from observer_rt.model.hydraulics import CONTROL_REFERENCE, Valve
from observer_rt.model.line import stiffened
from observer_rt.model.network import HIDDEN, OF_NOZZLE, Group, Network, network_with
from observer_rt.model.tangent import ByTheta

Theta = Floats
"""A parameter vector, as wide as its table: (m,)."""

NOZZLE, SEAT, OFFSET = "orifice_area", "seat_area", "line_pressure_sensor_offset"
"""Indicators that have a place of their own in tables and frames."""

EXACTLY = 1e-6  # standard deviation of the gain of sensors that are stated to be exact
GAIN_DRIFT = 1e-3  # drift of the gain from event to event, over its prior
WEIGHT_DRIFT = 0.002  # drift of the network's weights from event to event, over their prior
_TINY = 1e-100  # step of a complex derivative, which loses nothing by being small

_cached = lru_cache(maxsize=8, typed=True)
"""Cache, for an event is run several times, mostly with the same line; typed, for lines of two kinds may be equal."""


class Element(Enum):
    """Elements of the model in whose laws the core has numbers that are learned."""

    NOZZLE = "nozzle"
    SENSOR = "sensor"
    VALVE = "valve"
    NEEDLE = "needle"


class Origin(Enum):
    """Where a change begins: parts of injector and bench that change by themselves, each with its columns."""

    FLOW = "nozzle"  # and seat
    SENSOR = "sensor"  # of the line pressure
    LINE = "line"
    VALVE = "valve"
    NEEDLE = "needle"
    LIFT = "lift"


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
    begins_at: Origin | None = None  # None: its element, the line if it has a law of it, else nozzle or seat

    @property
    def origin(self) -> Origin:
        """Part of injector or bench with which the columns change."""
        by_law = Origin.LINE if self.change else Origin(self.element.value) if self.element else Origin.FLOW
        return self.begins_at or by_law


class Numbers(NamedTuple):
    """Columns of theta that are the numbers of an element's law, and SI sizes of theta = 1, of pressures in p_0."""

    columns: Ints
    sizes: Floats

    def of(self, theta: Floats) -> Floats:
        """The numbers in a parameter vector (m,)."""
        return np.asarray(theta[self.columns] * self.sizes)


class Alike(NamedTuple):
    """Two columns that one event may not tell apart, and the least value of the first that is carried on."""

    first: int
    other: int
    least: float


@dataclass(frozen=True)
class Gate:
    """Lowest values that the gated parameters may take, by column; held: columns that no event tells of.

    alike: while its first column is active, that stays at no price, and the other enters at a high one.
    """

    lowest: Mapping[int, float]
    held: tuple[int, ...] = ()
    alike: Alike | None = None

    @property
    def columns(self) -> tuple[int, ...]:
        """Columns of the gated parameters."""
        return tuple(self.lowest)


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

    def of_line(self, theta: Floats) -> tuple[float, ...]:
        """Entries of theta (m,) that change line and guide, in the order of `laws`."""
        values = theta.tolist()
        return tuple([values[column] for column, _ in self.laws])

    def prior(self, pressure_scale: float) -> Floats:
        """Standard deviations before any event; pressure_scale p_0 [Pa], as below."""
        return self._vector(attrgetter("prior"), pressure_scale)

    def drift(self, pressure_scale: float) -> Floats:
        """Standard deviations of the change from event to event."""
        return self._vector(attrgetter("drift"), pressure_scale)

    def longest_step(self, pressure_scale: float) -> Floats:
        """Longest steps of one iteration."""
        return self._vector(attrgetter("longest_step"), pressure_scale)

    def bounds(self, pressure_scale: float) -> tuple[Floats, Floats]:
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

    def columns_of(self, *origins: Origin) -> tuple[int, ...]:
        """Columns that change with these."""
        return tuple(row.column + i for row in self.rows if row.origin in origins for i in range(row.columns))

    def _vector(self, figure: Callable[[Scalar], float], pressure_scale: float) -> Floats:
        result = np.zeros(self.width)
        for row in self.rows:
            result[row.column : row.column + row.columns] = figure(row) / row.counted.unit(pressure_scale)
        return result


class Parameter(IntEnum):
    """Columns of theta by name."""

    NOZZLE_BIAS = 0  # b_H
    NOZZLE_WEIGHT = 1  # w_1; the others of the nozzle follow
    BACK_PRESSURE = 1 + OF_NOZZLE  # rise of p_C while injecting, in units of p_0; with the seat area follows
    SEAT_BIAS = 3 + OF_NOZZLE  # b_S
    SEAT_WEIGHT = 4 + OF_NOZZLE  # of its first neuron; the others follow
    LINE_PRESSURE_OFFSET = 4 + HIDDEN  # o, in units of p_0; acts in the sensor only
    LINE_FRICTION = 5 + HIDDEN  # k
    GUIDE_LEAKAGE = 6 + HIDDEN  # c p_0 / Q_0
    BULK_MODULUS = 7 + HIDDEN  # r
    SENSOR_LAG = 8 + HIDDEN  # tau, in units of LAG_UNIT; acts in the sensor only
    ENTRAINED_AIR = 9 + HIDDEN  # K g / p_0
    LINE_PRESSURE_GAIN = 10 + HIDDEN  # of its sensor over the rail's; acts in the sensor only
    CONTROL_FLOW = 11 + HIDDEN  # c, in units of Q_0 at p_0, beyond that of the file; and so on
    CONTROL_START = 12 + HIDDEN  # in units of LAG_UNIT
    CONTROL_END = 13 + HIDDEN
    CONTROL_HOLD = 14 + HIDDEN  # h
    CONTROL_EXPONENT = 15 + HIDDEN  # n
    DISPLACEMENT = 16 + HIDDEN  # A_d, as flow at 1 m/s in units of Q_0
    LIFT_DELAY = 17 + HIDDEN  # of the recorded needle lift against both pressures, in units of LAG_UNIT
    OPENING_DELAY = 18 + HIDDEN  # of a needle that answers commands, beyond that of the file, in units of LAG_UNIT
    OPENING_SPEED = 19 + HIDDEN  # natural logarithm of it over that of the file
    CLOSING_DELAY = 20 + HIDDEN
    CLOSING_SPEED = 21 + HIDDEN
    LANDING_BOUNCE = 22 + HIDDEN  # beyond that of the file, in units of LIFT_UNIT
    BOUNCE_LENGTH = 23 + HIDDEN
    BOUNCE_REST = 24 + HIDDEN  # from landing on, in units of LAG_UNIT


_MM3_PER_MS = MM3_PER_MS / 6e-5  # in units of the usual Q_0; of an area [mm2], the flow at 1 m/s


def _delay(effect: str, label: str) -> ShownIndicator:
    return ShownIndicator(effect, lambda _: LAG_UNIT, label=label, unit=("s", 1.0), screen_unit=("us", MICROSECOND))


def _weights(groups: Sequence[Group], column: int) -> Iterator[Scalar]:
    for group in groups:
        yield Scalar(
            group.name,
            column,
            prior=group.prior,
            drift=WEIGHT_DRIFT * group.prior,
            longest_step=1.0,
            bounds=(-1.0, 1.0),
            columns=group.neurons,
        )
        column += group.neurons


# fmt: off
SCALARS = Scalars((
    Scalar("nozzle_bias", Parameter.NOZZLE_BIAS, prior=0.45, drift=5e-4, longest_step=0.3, bounds=(-0.8, 1.5),
           shown=ShownIndicator(NOZZLE, key="nozzle_v_H")),
    *_weights(network.GROUPS[:FIRST_OF_SEAT], Parameter.NOZZLE_WEIGHT),
    Scalar("seat_bias", Parameter.SEAT_BIAS, prior=0.4, drift=5e-4, longest_step=0.3, bounds=(-0.8, 1.5),
           shown=ShownIndicator(SEAT, key="seat_v_S")),
    *_weights(network.GROUPS[FIRST_OF_SEAT:], Parameter.SEAT_WEIGHT),
    Scalar("friction", Parameter.LINE_FRICTION, prior=1.75, drift=2e-3, longest_step=1.2, bounds=(-0.95, 10.0),
           gated_from=-0.95, shown=ShownIndicator("line_friction", label="line friction k"),
           change=lambda line, k: line._replace(a4=line.a4 * (1.0 + k))),
    Scalar("leakage", Parameter.GUIDE_LEAKAGE, prior=0.09, drift=3.3e-4, longest_step=1.0, bounds=(0.0, 1.0),
           gated_from=0.0, shown=ShownIndicator("guide_leakage", lambda c: c.flow_scale / c.pressure_scale,
                                       label="guide leakage c", unit=("m3/(s Pa)", 1.0)),
           change=lambda line, c: line._replace(leak=line.leak + line.a1 * c)),
    Scalar("offset", Parameter.LINE_PRESSURE_OFFSET, prior=2.5e6, drift=2e3, longest_step=10e6, bounds=(-10e6, 10e6),
           counted=ScalarUnit.PRESSURE, begins_at=Origin.SENSOR,
           shown=ShownIndicator(OFFSET, lambda c: c.pressure_scale, label="line pressure sensor offset",
                                unit=("MPa", MEGAPASCAL))),
    Scalar("lag", Parameter.SENSOR_LAG, prior=35e-6, drift=0.1e-6, longest_step=25e-6, bounds=(0.0, 0.5e-3),
           counted=ScalarUnit.TIME, gated_from=0.0, element=Element.SENSOR,
           shown=_delay("line_pressure_sensor_lag", "line pressure sensor lag")),
    # Prior and drift are those of sensors without any, a bench's take their place.
    Scalar("gain", Parameter.LINE_PRESSURE_GAIN, prior=EXACTLY, drift=GAIN_DRIFT * EXACTLY, longest_step=0.02,
           bounds=(-0.1, 0.1), held=True, element=Element.SENSOR),
    Scalar("stiffness", Parameter.BULK_MODULUS, prior=0.18, drift=2e-4, longest_step=0.12, bounds=(-0.6, 1.0),
           gated_from=-0.6, shown=ShownIndicator("bulk_modulus", label="bulk modulus r"),
           change=stiffened, turn=0),
    Scalar("air", Parameter.ENTRAINED_AIR, prior=0.05, drift=1e-4, longest_step=0.04, bounds=(0.0, 0.5),
           gated_from=0.0, shown=ShownIndicator("entrained_air", lambda c: c.compression, label="entrained air g"),
           change=lambda line, g: line._replace(air=line.air + g)),
    Scalar("back_pressure", Parameter.BACK_PRESSURE, prior=5e6, drift=20e3, longest_step=30e6, bounds=(-30e6, 30e6),
           counted=ScalarUnit.PRESSURE, gated_from=0.0, columns=2, element=Element.NOZZLE),
    Scalar("control_flow", Parameter.CONTROL_FLOW, prior=4 * _MM3_PER_MS, drift=0.02 * _MM3_PER_MS,
           longest_step=6 * _MM3_PER_MS, bounds=(-30 * _MM3_PER_MS, 30 * _MM3_PER_MS),
           gated_from=0.0, shown=ShownIndicator("control_flow", lambda c: c.flow_scale * math.sqrt(
                                           CONTROL_REFERENCE / c.pressure_scale), label="control flow c",
                                       unit=("m3/s", 1.0), screen_unit=("mm3/ms", MM3_PER_MS)),
           change=lambda line, c: line._replace(control_flow=line.control_flow + line.a1 * c)),
    Scalar("control_start", Parameter.CONTROL_START, prior=80e-6, drift=10e-6, longest_step=40e-6,
           bounds=(-0.3e-3, 0.4e-3), counted=ScalarUnit.TIME, element=Element.VALVE),
    Scalar("control_end", Parameter.CONTROL_END, prior=80e-6, drift=10e-6, longest_step=40e-6,
           bounds=(-0.6e-3, 0.4e-3), counted=ScalarUnit.TIME, element=Element.VALVE),
    Scalar("control_hold", Parameter.CONTROL_HOLD, prior=0.3, drift=1e-3, longest_step=0.3, bounds=(-1.0, 1.0),
           element=Element.VALVE),
    Scalar("control_exponent", Parameter.CONTROL_EXPONENT, prior=0.4, drift=1e-3, longest_step=0.2,
           bounds=(-2.0, 2.0), element=Element.VALVE),
    Scalar("displacement", Parameter.DISPLACEMENT, prior=1.5 * _MM3_PER_MS, drift=0.005 * _MM3_PER_MS,
           longest_step=2 * _MM3_PER_MS, bounds=(-6 * _MM3_PER_MS, 6 * _MM3_PER_MS), gated_from=-6 * _MM3_PER_MS,
           change=lambda line, a: line._replace(displaced=line.displaced + line.a1 * a)),
    # It does not drift: an event that shows another one moves it, and no other.
    Scalar("lift_delay", Parameter.LIFT_DELAY, prior=1e-10, drift=0.0, longest_step=30e-6, bounds=(-0.2e-3, 0.2e-3),
           counted=ScalarUnit.TIME, begins_at=Origin.LIFT,
           shown=_delay("needle_lift_sensor_lag", "needle lift late by")),
    # Of the needle of a bench without its lift; they jitter from shot to shot.
    Scalar("opening_delay", Parameter.OPENING_DELAY, prior=70e-6, drift=1e-6, longest_step=40e-6,
           bounds=(-0.3e-3, 0.4e-3), counted=ScalarUnit.TIME, element=Element.NEEDLE,
           shown=_delay("needle_opens_later", "needle opens later by")),
    Scalar("opening_speed", Parameter.OPENING_SPEED, prior=0.17, drift=2e-3, longest_step=0.2, bounds=(-1.0, 1.0),
           element=Element.NEEDLE, shown=ShownIndicator("needle_opens_faster", label="needle opens faster, ln v")),
    Scalar("closing_delay", Parameter.CLOSING_DELAY, prior=110e-6, drift=1e-6, longest_step=40e-6,
           bounds=(-0.3e-3, 0.5e-3), counted=ScalarUnit.TIME, element=Element.NEEDLE,
           shown=_delay("needle_closes_later", "needle closes later by")),
    Scalar("closing_speed", Parameter.CLOSING_SPEED, prior=0.17, drift=2e-3, longest_step=0.2, bounds=(-1.0, 1.0),
           element=Element.NEEDLE, shown=ShownIndicator("needle_closes_faster", label="needle closes faster, ln v")),
    Scalar("landing_bounce", Parameter.LANDING_BOUNCE, prior=15e-6, drift=0.2e-6, longest_step=20e-6,
           bounds=(-80e-6, 80e-6), counted=ScalarUnit.LENGTH, gated_from=0.0, element=Element.NEEDLE,
           shown=ShownIndicator("needle_bounces", lambda _: LIFT_UNIT, label="needle bounces by", unit=("m", 1.0),
                                screen_unit=("um", MICROMETRE))),
    Scalar("bounce_length", Parameter.BOUNCE_LENGTH, prior=25e-6, drift=0.5e-6, longest_step=20e-6,
           bounds=(-60e-6, 80e-6), counted=ScalarUnit.TIME, element=Element.NEEDLE),
    Scalar("bounce_rest", Parameter.BOUNCE_REST, prior=20e-6, drift=0.5e-6, longest_step=20e-6,
           bounds=(0.0, 0.1e-3), counted=ScalarUnit.TIME, element=Element.NEEDLE),
))
# fmt: on

PARAMETERS = SCALARS.width
NOZZLE_LAW, SENSOR_LAW, VALVE_LAW, NEEDLE_LAW = map(SCALARS.numbers, Element)
EVERY = np.arange(PARAMETERS)


def with_gain(vector: Floats, gain: float) -> Floats:
    """The vector (m,) itself, its entry for the line-pressure sensor's gain raised in place to `gain` at least."""
    vector[Parameter.LINE_PRESSURE_GAIN] = max(vector[Parameter.LINE_PRESSURE_GAIN], gain)
    return vector


FLOWS = _NOZZLE, _SEAT = int(Parameter.NOZZLE_BIAS), int(Parameter.SEAT_BIAS)
"""Columns of the flows themselves, which may move on."""
WEIGHTS = np.delete(
    np.arange(Parameter.NOZZLE_WEIGHT, Parameter.LINE_PRESSURE_OFFSET), range(OF_NOZZLE, OF_NOZZLE + 3)
)
"""Columns of the network's weights, in the order of its neurons."""
LAWLESS = np.setdiff1d(EVERY, WEIGHTS)
"""Columns of all other parameters, without laws of nozzle and seat."""
_PLACED = "nozzle_bias", "nozzle_weight", "seat_bias", "seat_weight", "nozzle", "valve", "needle", "sensor", "offset"


class LearnedModel(NamedTuple):
    """Meaning of theta: phi's network, the changed coefficients, the sensor's offset [p_0] and law, the needle."""

    network: Network
    coefficients: Coefficients
    offset: float
    sensor: Floats  # (SENSOR_NUMBERS,): lag [s], gain over the rail sensor's
    lift_delay: float = 0.0  # s, by which the lift is recorded late; the stream does not undo it
    needle: Floats = np.zeros(NEEDLE_NUMBERS)  # (NEEDLE_NUMBERS,) of its law, if no lift is recorded


def nothing_learned(c: Coefficients) -> LearnedModel:
    """Meaning of theta = 0: the model in force, unchanged."""
    return LearnedModel(network.constant_network(), c, 0.0, np.zeros(SENSOR_NUMBERS))


def learned_of(theta: Floats, c: Coefficients) -> LearnedModel:
    """Meaning of a parameter vector (m,) on a model without it; cached: no caller may write into its arrays."""
    return _meaning(theta.tobytes(), c.line, c)


def sensor_lag(theta: Floats) -> float:
    """The lag tau of the line-pressure sensor [s] in a parameter vector (m,)."""
    return float(theta[Parameter.SENSOR_LAG]) * LAG_UNIT


def network_of(theta: Floats) -> Network:
    """The network in a parameter vector (m,)."""
    result = network_with(theta[WEIGHTS])
    result.bias[0], result.bias[1] = theta[_NOZZLE], theta[_SEAT]
    result.nozzle[:] = NOZZLE_LAW.of(theta)
    return result


def by_theta(theta: Floats, c: Coefficients, columns: Ints = EVERY, shots: int = 0) -> ByTheta:
    """Action of theta (m,) on a model without it: columns of the parameters, and slopes of the line by complex steps.

    columns (k,): whose tangents come first, those of `shots` delays next. Cached: callers must not write its arrays.
    """
    return _by_columns(c.line, SCALARS.of_line(theta), columns.tobytes(), shots)


@_cached
def _by_columns(line: Any, values: tuple[float, ...], wanted: bytes, shots: int) -> ByTheta:
    """`by_theta` of a line, by its entries in the order of `SCALARS.laws` and the bytes of the columns."""
    acting, columns = _by_values(line, values), np.frombuffer(wanted, np.int64)
    elsewhere = columns.size + 2 * shots
    column = np.full(PARAMETERS, elsewhere)
    column[columns] = np.arange(columns.size)
    is_wanted = column[acting.line_columns] < elsewhere
    return acting._replace(
        **{name: column[getattr(acting, name)] for name in _PLACED},
        neurons=network.NEURONS * (column[Parameter.NOZZLE_WEIGHT] < elsewhere),
        shots=shots,
        first_shot=columns.size,
        line_columns=column[acting.line_columns[is_wanted]],
        line_coefficients=acting.line_coefficients[is_wanted],
        line_slopes=acting.line_slopes[is_wanted],
        elsewhere=elsewhere,
    )


@_cached
def _meaning(content: bytes, line: Any, c: Coefficients) -> LearnedModel:
    theta = np.frombuffer(content)
    valve = Valve(*(np.array(c.valve) + np.append(VALVE_LAW.of(theta), (0.0, 0.0))).tolist())
    changed = c._replace(line=_changed(line, SCALARS.of_line(theta)), valve=valve)
    return LearnedModel(
        network_of(theta),
        changed,
        float(theta[Parameter.LINE_PRESSURE_OFFSET]),
        SENSOR_LAW.of(theta),
        float(theta[Parameter.LIFT_DELAY]) * LAG_UNIT,
        NEEDLE_LAW.of(theta),
    )


@_cached
def _by_values(line: Any, values: tuple[float, ...]) -> ByTheta:
    """Action of all columns of theta on a line, by its entries in the order of `SCALARS.laws`."""
    entries: list[tuple[int, int, float]] = []
    for row, (column, _) in enumerate(SCALARS.laws):
        stepped = (*values[:row], complex(values[row], _TINY), *values[row + 1 :])
        for number, coefficient in enumerate(_changed.__wrapped__(line, stepped)):
            slope = coefficient.imag / _TINY
            if slope != 0.0:
                entries.append((column, number, slope))
    columns, numbers, slopes = zip(*entries, strict=True)
    return ByTheta(
        nozzle_bias=_NOZZLE,
        nozzle_weight=int(Parameter.NOZZLE_WEIGHT),
        seat_bias=_SEAT,
        seat_weight=int(Parameter.SEAT_WEIGHT),
        neurons=network.NEURONS,
        basis=network.BASIS,
        nozzle=NOZZLE_LAW.columns,
        valve=VALVE_LAW.columns,
        valve_sizes=VALVE_LAW.sizes,
        needle=NEEDLE_LAW.columns,
        needle_sizes=NEEDLE_LAW.sizes,
        shots=0,
        first_shot=PARAMETERS,
        sensor=SENSOR_LAW.columns,
        offset=int(Parameter.LINE_PRESSURE_OFFSET),
        line_columns=np.array(columns, np.int64),
        line_coefficients=np.array(numbers, np.int64),
        line_slopes=np.array(slopes, np.float64),
        elsewhere=PARAMETERS,
    )


@_cached
def _changed(line: Any, values: tuple[Any, ...]) -> Any:
    for (_, change), value in zip(SCALARS.laws, values, strict=True):
        line = change(line, value)
    return line
