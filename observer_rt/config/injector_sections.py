"""Sections of a bench file for one injector: signals, recordings, model, observation, destinations of results."""

from collections.abc import Iterator
from enum import StrEnum
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from observer_rt.config.signals import Role, SignalsConfig
from observer_rt.foundation.documents import Section
from observer_rt.foundation.units import LENGTH_UNITS, PRESSURE_UNITS, TEMPERATURE_ORIGINS

OneCharacter = Annotated[str, Field(min_length=1, max_length=1)]

Identifier = Annotated[int, Field(ge=0, le=0x1FFF_FFFF)]
LOWEST_RATE, HIGHEST_RATE = 1e3, 1e6  # Hz, of samples
SampleRate = Annotated[float, Field(ge=LOWEST_RATE, le=HIGHEST_RATE)]


class Meaning(StrEnum):
    """Meaning of a sample: the value at its time, or the mean over the sample period that ends there."""

    INSTANT = "instant"
    MEAN = "mean"


Column = Annotated[str, BeforeValidator(lambda name: f"#{name}" if isinstance(name, int) else name)]
"""Its name; in text also its number from 1, as an integer or as `#2`, which is no name there."""


class ColumnConfig(Section):
    """A column of a CSV or Parquet file, or a channel of an MDF4 file: `(value * factor + offset)` is in `unit`."""

    column: Annotated[Column, Field(min_length=1)]
    unit: str | None = None  # None: as the file says
    factor: float = 1.0
    offset: float = 0.0
    group: Annotated[int, Field(ge=0)] | None = None  # of an MDF4 file, where several groups have the channel

    @model_validator(mode="after")
    def _changes_something(self) -> Self:
        if self.factor == 0.0:
            raise ValueError("'factor' is 0, which leaves nothing of the values; state another, or leave it out")
        return self

    @property
    def number(self) -> int | None:
        """Number of the column from 1, of a text table; None: it goes by its name."""
        return int(self.column[1:]) if self.column[:1] == "#" and self.column[1:].isdecimal() else None


class TimeConfig(ColumnConfig):
    """The column of the time: numbers in `unit`, or in CSV stamps of a calendar, written in `format`."""

    format: Annotated[str, Field(min_length=1)] | None = None  # as of strptime; None: numbers, or ISO 8601

    @model_validator(mode="after")
    def _is_one_kind(self) -> Self:
        if self.format is not None and self.model_fields_set & {"unit", "factor", "offset"}:
            raise ValueError("stamps of a calendar have no 'unit', 'factor' or 'offset'; leave out these or 'format'")
        return self


class RecordingConfig(Section):
    """The mapping of recordings that are not in a layout of our own."""

    rail_pressure: ColumnConfig
    needle_lift: ColumnConfig | None = None  # without it the energizing, or a table of shots, is needed
    line_pressure: ColumnConfig
    injection_rate: ColumnConfig | None = None
    energizing: ColumnConfig | None = None
    chamber_pressure: ColumnConfig | None = None
    fuel_temperature: ColumnConfig | None = None
    time: TimeConfig | None = None  # MDF4 files bring their own; others need it, or `rate_hz`
    rate_hz: SampleRate | None = None
    """Rate at which rows follow each other where no column is the time; also that of the grid."""
    separator: OneCharacter | None = None  # of CSV, as the next one; None: as the file looks
    decimal: OneCharacter | None = None
    meaning: Meaning | None = None  # of their samples; None: as [sampling] says
    bridge_ms: Annotated[float, Field(ge=0.0, le=100.0)] = 0.05  # gaps up to this become a straight line

    @field_validator("rail_pressure", "needle_lift", "line_pressure", "chamber_pressure", "fuel_temperature")
    @classmethod
    def _known_unit(cls, column: ColumnConfig | None, field: ValidationInfo) -> ColumnConfig | None:
        others = {"needle_lift": LENGTH_UNITS, "fuel_temperature": TEMPERATURE_ORIGINS}
        units = others.get(str(field.field_name), PRESSURE_UNITS)
        if column is not None and column.unit is not None and column.unit not in units:
            raise ValueError(f"{column.unit!r} is no unit of this quantity; write one of {', '.join(units)}")
        return column

    @model_validator(mode="after")
    def _separators_differ(self) -> Self:
        if self.separator is not None and self.separator == self.decimal:
            raise ValueError(f"'separator' and 'decimal' are both {self.decimal!r}; change one of them")
        return self

    @property
    def signals(self) -> Iterator[tuple[str, ColumnConfig]]:
        """The signals mapped, by their names in a `Recording`."""
        for name in RecordingConfig.model_fields:
            if isinstance(column := getattr(self, name), ColumnConfig) and name != "time":
                yield name, column


class SamplingConfig(Section):
    rate_hz: SampleRate = 100e3
    meaning: Meaning = Meaning.INSTANT
    bridge_ms: Annotated[float, Field(ge=0, le=5)] = 0.5  # of a signal that is frozen or drops out
    rate_meter_ms: tuple[Annotated[float, Field(gt=0, le=2)], ...] | None = None  # its poles; None: `fit` finds them


class ModelConfig(Section):
    file: str | None = None  # relative to the bench file; None: the nominal injector of the package


class NoiseConfig(Section):
    """Noise of one sample (standard deviation), used until enough standstill was seen."""

    rail_pressure_MPa: Annotated[float, Field(gt=0, le=5)] = 0.10  # noqa: N815 - units as on screens
    line_pressure_MPa: Annotated[float, Field(gt=0, le=5)] = 0.15  # noqa: N815
    needle_lift_um: Annotated[float, Field(gt=0, le=20)] = 0.4


class E2EConfig(Section):
    """The state machine of protected inputs (AUTOSAR E2E_SM): how many of a message's last frames must be good.

    The limits of a state say when a message is VALID next. While it is INVALID, none of its values are taken.
    """

    window: Annotated[int, Field(ge=1, le=62)] = 10  # frames
    init_min_ok: Annotated[int, Field(ge=0)] = 1
    init_max_errors: Annotated[int, Field(ge=0)] = 5
    valid_min_ok: Annotated[int, Field(ge=0)] = 0  # the sample index gives the order
    valid_max_errors: Annotated[int, Field(ge=0)] = 5
    invalid_min_ok: Annotated[int, Field(ge=0)] = 5
    invalid_max_errors: Annotated[int, Field(ge=0)] = 2

    @model_validator(mode="after")
    def _harder_to_become_valid_than_to_stay(self) -> Self:
        oks = (self.valid_min_ok, self.init_min_ok, self.invalid_min_ok, self.window)
        errors = (self.invalid_max_errors, self.init_max_errors, self.valid_max_errors)
        if sorted(oks) != list(oks) or sorted(errors) != list(errors):
            raise ValueError(
                "a message would become VALID more easily than it stays so; keep valid_min_ok <= init_min_ok <= "
                "invalid_min_ok <= window and invalid_max_errors <= init_max_errors <= valid_max_errors"
            )
        return self


class OutputsConfig(Section):
    """Messages the results go out in; signals are found in them by their names in observer_fd.dbc."""

    injection_rate: str | Literal[False] = "InjectionRate"  # false: not published
    corrected_rate: str | Literal[False] = False  # by an injection's own pressures, once its event was judged
    injection_summary: str = "InjectionSummary"
    status: str = "ObserverStatus"
    injection_rate_id: Identifier | None = None  # instead of that in the database; above 0x7FF it is extended
    corrected_rate_id: Identifier | None = None
    injection_summary_id: Identifier | None = None
    status_id: Identifier | None = None
    injector_id: Annotated[int, Field(ge=0, le=255)] = 1
    status_period_ms: Annotated[float, Field(ge=10, le=10_000)] = 100.0
    link: str | None = None  # the bus they are sent on, instead of their database's


class LearningConfig(Section):
    enabled: bool = True
    on_inadequate_model: bool = False  # learn and publish as valid although the fit was inadequate
    event_gap_ms: Annotated[float, Field(ge=2, le=50)] = 10.0
    learning_delay_ms: Annotated[float, Field(ge=0, le=1000)] = 20.0
    lockstep: bool = False


class StateConfig(Section):
    """Files of the observer on disk; they are relative to the bench file, None: not written."""

    file: str | None = None  # of what was learned
    journal: str | None = None  # of the injections
    save_within_s: Annotated[float, Field(ge=0.1, le=3600)] = 5.0  # of being learned, or of the injection


class EvidenceConfig(Section):
    """Folder of inputs that speak against the model; relative to the bench file, None: nothing is kept."""

    folder: str | None = None
    most_mib: Annotated[float, Field(ge=1.0, le=1e6)] = 200.0
    per_point: Annotated[int, Field(ge=2, le=1000)] = 8  # events of a kind at one operating point


class InjectorConfig(Section):
    """The sections of a bench file that are an injector's."""

    signals: SignalsConfig
    sampling: SamplingConfig = SamplingConfig()
    model: ModelConfig = ModelConfig()
    noise: NoiseConfig = NoiseConfig()
    e2e: E2EConfig = E2EConfig()
    outputs: OutputsConfig = OutputsConfig()
    learning: LearningConfig = LearningConfig()
    state: StateConfig = StateConfig()
    evidence: EvidenceConfig = EvidenceConfig()
    recording: RecordingConfig | None = None  # of files in a layout of the user's own

    @property
    def stated_links(self) -> list[tuple[str, str | None]]:
        """The buses named, with the sections that name them."""
        mappings = {f"signals.{role}": self.signals.of(role) for role in Role}
        optional = {f"signals.{role}": mapping for role, mapping in self.signals.optional}
        pulses = {} if self.signals.energizing is None else {"signals.energizing": self.signals.energizing}
        sections = mappings | optional | pulses | {"outputs": self.outputs}
        return [(key, section.link) for key, section in sections.items()]
