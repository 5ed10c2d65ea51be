"""Guess of a file's `[recording]` section: the column of each signal by names, units and behaviour, and doubts."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from observer_rt.config.injector import RecordingConfig
from observer_rt.files.guess.behaviour import RATES
from observer_rt.files.guess.candidates import ColumnCandidate, candidates_of
from observer_rt.files.guess.choice import (
    UNKNOWN,
    Chosen,
    chosen_lift,
    chosen_pressures,
    chosen_rate,
    chosen_time,
)
from observer_rt.files.guess.naming import RATE
from observer_rt.files.signals.column import Column
from observer_rt.files.signals.table import TIME
from observer_rt.foundation.errors import UserError

NEEDED = ("rail_pressure", "needle_lift", "line_pressure")
_SHOWN = 20  # columns


@dataclass(frozen=True)
class GuessedColumn:
    """Column guessed for a signal, or for the time. why: in a few words; doubt: empty where there is none."""

    signal: str
    column: str | int
    unit: str
    why: str
    doubt: str = ""
    factor: float = 1.0
    offset: float = 0.0
    group: int | None = None

    def entries(self) -> Iterator[tuple[str, Any]]:
        """Keys and values of its section."""
        yield "column", self.column
        if self.unit:
            yield "unit", self.unit
        if self.factor != 1.0:
            yield "factor", self.factor
        if self.offset != 0.0:
            yield "offset", self.offset
        if self.group is not None:
            yield "group", self.group


@dataclass(frozen=True)
class Guess:
    """Guess of how a file is read. place: the file; missing: signals without a column; rate: of its rows [Hz];
    others: names of columns that are not used."""

    place: str
    columns: tuple[GuessedColumn, ...]
    missing: tuple[str, ...]
    rate: float
    rate_doubt: str
    others: tuple[str, ...]

    @property
    def doubts(self) -> tuple[str, ...]:
        """What speaks against it, or is not known."""
        own = [f"{each.signal}: {each.doubt}" for each in self.columns if each.doubt]
        lacking = [f"{signal}: no column looks like it" for signal in self.missing]
        return (*lacking, *own, *([self.rate_doubt] if self.rate_doubt else []))

    @property
    def layout(self) -> RecordingConfig:
        """The mapping. Raises `UserError` where a signal has no column or unit, and for a rate that nothing takes."""
        if self.missing or any(each.unit == UNKNOWN for each in self.columns) or not _can_be_read(self.rate):
            raise self.error()
        content: dict[str, Any] = {each.signal: dict(each.entries()) for each in self.columns}
        return RecordingConfig.model_validate({**content, "rate_hz": self.rate or None})

    def section(self) -> str:
        """The `[recording]` section to keep, with places to fill in."""
        lines = [
            "[recording]",
            f"rate_hz = {self.rate:.10g}" if self.rate else "rate_hz = ...  # rows a second",
        ]
        for each in self.columns:
            lines += ["", f"[recording.{each.signal}]"]
            lines += [f"{key} = {_as_toml(value)}" for key, value in each.entries()]
        for signal in self.missing:
            known = ", ".join(self.others[:_SHOWN])
            end = "; or leave this out, and state rate_hz" if signal == TIME else ""
            lines += ["", f"[recording.{signal}]", f'column = "..."  # one of {known}{end}', 'unit = "..."']
        return "\n".join(lines)

    def in_words(self) -> str:
        """One line that says which column is which signal."""
        units = [f" in {each.unit}" if each.unit else "" for each in self.columns]
        parts = [
            f"{each.signal} is '{each.column}'{unit}" for each, unit in zip(self.columns, units, strict=True)
        ]
        return f"{self.place}: guessed: {', '.join(parts)}; {self.rate:.10g} Hz"

    def error(self) -> UserError:
        """The error for who cannot be asked."""
        as_it_is = "" if self.missing else " (evaluate, fit and discover take it as it is by --yes)"
        return UserError(
            self.place,
            f"which column is which is not certain: {'; '.join(self.doubts)}",
            f"keep this, corrected, in a bench file, given by --bench{as_it_is}:\n\n{self.section()}\n",
        )


@np.errstate(over="ignore", invalid="ignore")  # of damaged columns
def guess_of(place: str, columns: Sequence[Column]) -> Guess:
    """Guess from columns, or the beginning of columns. Raises `UserError` where there are none."""
    found = candidates_of(columns)
    if not found:
        raise UserError(place, "holds no column of numbers", "give a file with a column for each signal")
    brings_time = any(each.column.time is not None for each in found)
    time = None if brings_time else chosen_time(found)
    signals = [each for each in found if time is None or each is not time.candidate]
    lift = chosen_lift(signals)
    pressures = chosen_pressures(
        [each for each in signals if lift is None or each is not lift.candidate], lift
    )
    rest = [
        each for each in signals if each not in [one.candidate for one in (lift, *pressures.values()) if one]
    ]
    chosen = {TIME: time, "needle_lift": lift, **pressures, RATE: chosen_rate(rest)}
    needed = NEEDED if brings_time else (TIME, *NEEDED)
    missing = tuple(signal for signal in needed if chosen.get(signal) is None)
    rate, doubt = (lift.candidate.own_rate(), "") if brings_time and lift else (0.0, "")
    if time is not None:
        rate, doubt = time.rate, time.rate_doubt
    if not _can_be_read(rate):
        doubt = f"{rate:.6g} rows a second are too few or too many: mind the time, and its unit"
    guessed = tuple(_guessed({name: one for name, one in chosen.items() if one is not None}, found))
    used = {one.candidate for one in chosen.values() if one is not None}
    others = tuple(each.column.name or str(each.place) for each in found if each not in used)
    return Guess(place, guessed, missing, rate, doubt, others)


def _guessed(chosen: Mapping[str, Chosen], found: Sequence[ColumnCandidate]) -> Iterator[GuessedColumn]:
    """Columns by their names, all by their places where one has none."""
    are_named = all(one.candidate.column.name for one in chosen.values())
    for signal in (TIME, *NEEDED, RATE):
        if (one := chosen.get(signal)) is not None:
            each = one.candidate
            group = each.column.group if _is_shared(each, found) else None
            key = each.column.name if are_named else each.place
            yield GuessedColumn(signal, key, one.unit, one.why, one.doubt, one.factor, one.offset, group)


def _can_be_read(rate: float) -> bool:
    lowest, highest = RATES
    return not rate or lowest <= rate <= highest


def _is_shared(candidate: ColumnCandidate, others: Sequence[ColumnCandidate]) -> bool:
    return sum(other.column.name == candidate.column.name for other in others) > 1


def _as_toml(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
