"""Where the signals are in recordings of the user's own, as a bench file says it: names, units, dialect, gaps."""

from collections.abc import Iterator
from enum import StrEnum
from typing import Annotated, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from observer_rt.config.toml_file import Section
from observer_rt.foundation.units import LENGTH_UNITS, PRESSURE_UNITS


class Meaning(StrEnum):
    """What a sample is: the value at its time, or the mean over the sample period that ends there."""

    INSTANT = "instant"
    MEAN = "mean"


OneCharacter = Annotated[str, Field(min_length=1, max_length=1)]


class ColumnConfig(Section):
    """A column of a CSV or Parquet file, or a channel of an MDF4 file: `(value * factor + offset)` is in `unit`."""

    column: Annotated[str, Field(min_length=1)] | Annotated[int, Field(ge=1)]
    """A number: its place, from 1, in a CSV file that names none."""
    unit: str | None = None  # None: as the file says
    factor: float = 1.0
    offset: float = 0.0
    group: Annotated[int, Field(ge=0)] | None = (
        None  # of an MDF4 file, where several have a channel of this name
    )

    @model_validator(mode="after")
    def _changes_something(self) -> Self:
        if self.factor == 0.0:
            raise ValueError(
                "'factor' is 0, which leaves nothing of the values; state another, or leave it out"
            )
        return self

    @property
    def name(self) -> str:
        """What it is called; `column 3` where the file has no names."""
        return self.column if isinstance(self.column, str) else f"column {self.column}"


class TimeConfig(ColumnConfig):
    """The column of the time: numbers in `unit`, or in CSV stamps of a calendar, written in `format`."""

    format: Annotated[str, Field(min_length=1)] | None = None  # as of strptime; None: numbers, or ISO 8601

    @model_validator(mode="after")
    def _is_one_kind(self) -> Self:
        if self.format is not None and self.model_fields_set & {"unit", "factor", "offset"}:
            raise ValueError(
                "stamps of a calendar have no 'unit', 'factor' or 'offset'; leave out these, or 'format'"
            )
        return self


class RecordingConfig(Section):
    """The mapping of recordings that are not in a layout of our own."""

    rail_pressure: ColumnConfig
    needle_lift: ColumnConfig
    line_pressure: ColumnConfig
    injection_rate: ColumnConfig | None = None
    time: TimeConfig | None = None  # MDF4 files bring their own
    separator: OneCharacter | None = None  # of CSV, as are the next two; None: as the file looks
    decimal: OneCharacter | None = None
    comment: OneCharacter = "#"
    meaning: Meaning | None = None  # of their samples; None: as [sampling] says
    bridge_ms: Annotated[float, Field(ge=0.0, le=100.0)] = 0.05  # gaps up to this become a straight line

    @field_validator("rail_pressure", "needle_lift", "line_pressure")
    @classmethod
    def _known_unit(cls, column: ColumnConfig, field: ValidationInfo) -> ColumnConfig:
        units = LENGTH_UNITS if field.field_name == "needle_lift" else PRESSURE_UNITS
        if column.unit is not None and column.unit not in units:
            raise ValueError(f"{column.unit!r} is no unit of this quantity; write one of {', '.join(units)}")
        return column

    @model_validator(mode="after")
    def _separators_differ(self) -> Self:
        if self.separator is not None and self.separator == self.decimal:
            raise ValueError(f"'separator' and 'decimal' are both {self.decimal!r}; change one of them")
        return self

    @model_validator(mode="after")
    def _names_or_places(self) -> Self:
        columns = [column for _, column in self.signals] + ([self.time] if self.time else [])
        if len({type(column.column) for column in columns}) > 1:
            raise ValueError(
                "some columns are named, others given by their places; name all, or give places only in a CSV "
                "file without names"
            )
        return self

    @property
    def by_place(self) -> bool:
        """Whether columns are given by their places, not by names."""
        return isinstance(self.rail_pressure.column, int)

    @property
    def signals(self) -> Iterator[tuple[str, ColumnConfig]]:
        """The signals mapped, by their names in a `Recording`."""
        for name in ("rail_pressure", "needle_lift", "line_pressure", "injection_rate"):
            if (column := getattr(self, name)) is not None:
                yield name, column
