"""Variables of laws, and the units in which laws are computed."""

import re
from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple, Self

SYMBOLS = ("mm", "ms", "s", "MPa")

_FACTOR = re.compile(r"([*/]?)(-|1|[A-Za-z]+[23]?)(?:\^(-?\d+(?:\.\d+)?))?")


class Unit(NamedTuple):
    """Powers of the units in which laws are computed (s is not ms: nothing converts), and of that of `c`."""

    mm: float = 0.0
    ms: float = 0.0
    s: float = 0.0
    MPa: float = 0.0
    c: float = 0.0

    def times(self, other: "Unit", power: float = 1.0) -> "Unit":
        """The unit of a product with the other, raised to a power first."""
        return Unit(*(round(own + power * further, 6) for own, further in zip(self, other, strict=True)))

    def raised(self, power: float) -> "Unit":
        """The unit raised to a power."""
        return PURE.times(self, power)

    def __str__(self) -> str:
        above = [_power(name, power) for name, power in zip(SYMBOLS, self, strict=False) if power > 0.0]
        below = [_power(name, -power) for name, power in zip(SYMBOLS, self, strict=False) if power < 0.0]
        if not above and not below:
            return "-"
        return "/".join(["*".join(above) or "1", *below])


def _power(name: str, power: float) -> str:
    if power == 1.0:
        return name
    return f"{name}{power:g}" if name == "mm" and power in (2.0, 3.0) else f"{name}^{power:g}"


PURE = Unit()
_UNITS = {  # factor and unit by the name that users write
    "-": (1.0, PURE),
    "1": (1.0, PURE),
    "mm": (1.0, Unit(mm=1.0)),
    "mm2": (1.0, Unit(mm=2.0)),
    "mm3": (1.0, Unit(mm=3.0)),
    "um": (1e-3, Unit(mm=1.0)),
    "MPa": (1.0, Unit(MPa=1.0)),
    "bar": (0.1, Unit(MPa=1.0)),
    "ms": (1.0, Unit(ms=1.0)),
    "us": (1e-3, Unit(ms=1.0)),
    "s": (1.0, Unit(s=1.0)),
    "kHz": (1.0, Unit(ms=-1.0)),
    "Hz": (1.0, Unit(s=-1.0)),
}
UNIT_NAMES = tuple(_UNITS)


def unit_named(text: str) -> tuple[float, Unit] | None:
    """Factor and unit of `text`, such as `mm3/ms/MPa^0.5`, in the units of laws; None if it is no unit."""
    scale, unit, position, text = 1.0, PURE, 0, text.replace(" ", "")
    while position < len(text):
        match = _FACTOR.match(text, position)
        if match is None or match[2] not in _UNITS or (position == 0) == bool(match[1]):
            return None
        power = float(match[3] or 1.0) * (-1.0 if match[1] == "/" else 1.0)
        size, base = _UNITS[match[2]]
        scale, unit, position = scale * size**power, unit.times(base, power), match.end()
    return (scale, unit) if position else None


PRESSURE, FLOW, LIFT, DURATION = Unit(MPa=1.0), Unit(mm=3.0, ms=-1.0), Unit(mm=1.0), Unit(ms=1.0)


class Variable(IntEnum):
    """Variable of a law, with its unit, in the order of the array that a program reads; pressures are absolute."""

    RAIL_PRESSURE = 0, PRESSURE
    LINE_PRESSURE = 1, PRESSURE
    SAC_PRESSURE = 2, PRESSURE
    CHAMBER_PRESSURE = 3, PRESSURE
    LINE_FLOW = 4, FLOW
    SEAT_FLOW = 5, FLOW
    NOZZLE_FLOW = 6, FLOW
    NEEDLE_LIFT = 7, LIFT
    MAX_LIFT = 8, LIFT
    LIFT_RATE = 9, LIFT.times(DURATION, -1.0)
    RAIL_PRESSURE_RATE = 10, PRESSURE.times(DURATION, -1.0)
    LINE_PRESSURE_RATE = 11, PRESSURE.times(DURATION, -1.0)
    TIME_SINCE_OPENING = 12, DURATION
    TIME = 13, Unit(s=1.0)  # in the recording, or since the start
    INJECTION_NUMBER = 14  # 1, 2, ...
    OPEN = 15  # 0 or 1, as those below
    CLOSED = 16
    OPENING = 17
    CLOSING = 18

    unit: Unit

    def __new__(cls, number: int, unit: Unit = PURE) -> Self:
        """A member that is its number and knows its unit."""
        member = int.__new__(cls, number)
        member._value_, member.unit = number, unit
        return member

    @property
    def word(self) -> str:
        """Name of the variable in a law."""
        return self.name.lower()


VARIABLES: Mapping[str, Variable] = {variable.word: variable for variable in Variable}
