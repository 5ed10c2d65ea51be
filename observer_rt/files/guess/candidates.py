"""Columns as candidates for signals: their numbers, and what name and unit say of each signal."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from observer_rt.files.guess.behaviour import Pulses, is_pressure, pulses_of
from observer_rt.files.guess.naming import is_of_another_quantity, known_unit, signals_named, unit_in_name
from observer_rt.files.signals.column import Column, Values, moments_as_seconds
from observer_rt.files.signals.header import ISO_8601, Calendar
from observer_rt.files.signals.number_text import cells_as_numbers
from observer_rt.files.signals.pacing import Stamps, stamps_of

_VOLTS = ("v", "mv", "ma")  # of a sensor whose curve is to be stated


@dataclass(frozen=True, eq=False)
class ColumnCandidate:
    """A column that holds numbers, or moments, which are seconds here. place: in the file, from 1."""

    column: Column
    place: int
    values: Values
    is_calendar: bool

    @cached_property
    def named(self) -> set[str]:
        """Signals that its name speaks of."""
        return signals_named(self.column.name)

    @cached_property
    def pulses(self) -> Pulses | None:
        """Its pulses, if it rests between them."""
        return pulses_of(self.values)

    @cached_property
    def is_pressure(self) -> bool:
        """Whether it could be a pressure by its values."""
        return is_pressure(self.values)

    @cached_property
    def stamps(self) -> Stamps | None:
        """How it goes on, if it could be a time."""
        return stamps_of(self.values)

    def unit_of(self, signal: str) -> str:
        """Its unit as stated, or by its name, for a signal; empty for none."""
        if self.column.unit:
            return known_unit(signal, self.column.unit)
        return unit_in_name(signal, self.column.name)

    def is_told(self, signal: str) -> bool:
        """Whether name and unit both say that it is a signal: the needle may be shut all the time."""
        return signal in self.named and bool(self.unit_of(signal))

    def is_raw(self) -> bool:
        """Whether it is what a sensor gives, not what it measures."""
        return self.column.unit.lower() in _VOLTS

    def score(self, signal: str) -> int:
        """How much of name and unit speaks for a signal; below 0: it is none."""
        if self.is_calendar:
            return -1
        score = 4 if signal in self.named else -4 if self.named else 0
        if self.unit_of(signal):
            return score + 2
        is_other = bool(self.column.unit) and not (self.is_raw() and signal in self.named)
        return -9 if is_other or is_of_another_quantity(signal, self.column.unit) else score

    def own_rate(self) -> float:
        """Rate [Hz] of a channel that brings its own stamps; 0 of none."""
        found = None if self.column.time is None else stamps_of(self.column.time)
        return 0.0 if found is None else found.rate(1.0)


def candidates_of(columns: Sequence[Column]) -> list[ColumnCandidate]:
    """The columns that can be something."""
    found = []
    for place, column in enumerate(columns, 1):
        values, is_calendar = _numbers(column)
        if values is not None and values.size > 2 and np.isfinite(values).any():
            found.append(ColumnCandidate(column, place, values, is_calendar))
    return found


def _numbers(column: Column) -> tuple[Values | None, bool]:
    """Values as numbers, None for other text; whether they are moments."""
    if column.is_calendar:
        return moments_as_seconds(column.values), True
    if not column.is_text:
        return (
            (column.values.astype(np.float64), False) if column.values.dtype.kind in "iuf" else (None, False)
        )
    cells = column.cells
    try:
        return cells_as_numbers(cells, None, None), False
    except ValueError:
        calendar = Calendar(ISO_8601)
        first = calendar.nanoseconds(cells[:1])
        seconds = calendar.seconds(cells, int(first[0]))
        return (seconds, True) if np.isfinite(seconds).all() else (None, True)
