"""Signals that carry the observer's inputs, as a bench file states them, and the effects of their delays and lags.

`bus/alignment.py` undoes delays of lift and rail messages; the model gets all others, and lags, as effects.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Self

from pydantic import Field, field_validator, model_validator

from observer_rt.foundation.documents import Section
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MASS_UNITS, MICROSECOND, PRESSURE_UNITS, TEMPERATURE_ORIGINS
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import sized
from observer_rt.model.parameters import InjectorParameters, Positive
from observer_rt.model.surroundings import CHAMBER_PRESSURES, TEMPERATURES, Surroundings

MOST_APART_US = 60.0  # of filter delays of two channels, in recordings
_NO_DELAYS = {"filter_delay_us": 0.0, "lag_us": 0.0}


class Role(StrEnum):
    """Roles of the signals that the observer needs."""

    RAIL_PRESSURE = "rail_pressure"
    NEEDLE_LIFT = "needle_lift"
    LINE_PRESSURE = "line_pressure"


class OptionalRole(StrEnum):
    """Roles of slow signals that the observer uses where a bench has them."""

    LEARNING_ENABLE = "learning_enable"
    MEASURED_MASS = "measured_mass"
    FUEL_TEMPERATURE = "fuel_temperature"
    CHAMBER_PRESSURE = "chamber_pressure"


@dataclass(frozen=True)
class OptionalSignal:
    """Description of an optional role, for the bus and for `check`.

    use: purpose of its values; possible: lowest, highest [SI]; wrong: words for signals outside; expires: values
    count for a time only; usual: value [SI] in frames made of recordings, unless `always` only where no frame can
    mark it not available; units: factors to SI, or origins: zeros of the scales [K]; shown: unit of screens, None:
    not shown; step: change [SI] of one of the `Surroundings` below which the model stays.
    """

    use: str
    possible: tuple[float, float]
    wrong: str
    expires: bool = False
    usual: Callable[[InjectorParameters], float] = lambda _: math.nan
    always: bool = True
    units: Mapping[str, float] | None = None
    origins: Mapping[str, float] | None = None
    shown: str = ""
    step: float = math.inf

    def to_si(self, unit: str) -> tuple[float, float]:
        """Factor and origin of a unit: value_si = value * factor + origin."""
        return (self.units or {}).get(unit, 1.0), (self.origins or {}).get(unit, 0.0)


OPTIONAL_SIGNALS: Mapping[OptionalRole, OptionalSignal] = {
    OptionalRole.LEARNING_ENABLE: OptionalSignal(  # a frame made of a recording must not switch learning off
        "learning stops while it is 0", (0.0, 0.0), "which it cannot be", True, lambda _: 1.0, always=False
    ),
    OptionalRole.MEASURED_MASS: OptionalSignal(
        "compared with the estimate", (math.ulp(0.0), math.inf), "never positive", units=MASS_UNITS, shown="mg"
    ),
    OptionalRole.FUEL_TEMPERATURE: OptionalSignal(
        "",
        TEMPERATURES,
        "no temperature of a fuel; what is its unit?",
        step=0.1,  # K: .04 % of the bulk modulus, less than injections differ by
        expires=True,
        usual=lambda injector: injector.fluid.reference_temperature or math.nan,
        origins=TEMPERATURE_ORIGINS,
        shown="degC",
    ),
    OptionalRole.CHAMBER_PRESSURE: OptionalSignal(
        "the model's p_C",
        CHAMBER_PRESSURES,
        "no pressure of a chamber; what is its unit?",
        expires=True,
        usual=lambda injector: injector.chamber.pressure,
        units=PRESSURE_UNITS,
        shown="MPa",
        step=0.02e6,  # Pa: .02 % of the mass at 50 MPa
    ),
}


def in_units(surroundings: Surroundings) -> dict[str, float]:
    """Measured surroundings by names that end in their units, such as `fuel_temperature_degC`."""
    roles = {OptionalRole(role): value for role, value in surroundings._asdict().items() if value is not None}
    scales = {role: OPTIONAL_SIGNALS[role].to_si(OPTIONAL_SIGNALS[role].shown) for role in roles}
    return {
        f"{role}_{OPTIONAL_SIGNALS[role].shown}": (value - scales[role][1]) / scales[role][0]
        for role, value in roles.items()
    }


def in_words(surroundings: Surroundings) -> list[str]:
    """Measured surroundings in words, such as `fuel_temperature 40.0 degC`."""
    parts = ((*name.rsplit("_", 1), value) for name, value in in_units(surroundings).items())
    return [f"{role} {value:.1f} {unit}" for role, unit, value in parts]


class SampledConfig(Section):
    """Samples of a message: its signals, by one of `signal`, `signals`, `pattern`."""

    message: str
    signal: str | None = None
    signals: tuple[str, ...] | None = None
    pattern: str | None = None
    time_base: str = "device"
    index: str | None = None  # signal with the index of the frame's first sample; "": none
    delay_us: Annotated[float, Field(ge=0, le=1e6)] | None = None  # from a frame's last sample to its stamp
    unit: str | None = None  # replaces the unit of the bus database
    link: str | None = None  # the bus the message is on, instead of its database's

    @model_validator(mode="after")
    def _one_way_to_name_signals(self) -> Self:
        if sum(value is not None for value in (self.signal, self.signals, self.pattern)) != 1:
            raise ValueError("its samples are not named once; state exactly one of 'signal', 'signals' or 'pattern'")
        return self

    @property
    def names(self) -> str | tuple[str, ...]:
        """The signals, as `lookup.signal_names` takes them."""
        return self.signal or self.pattern or self.signals or ()


class SignalConfig(SampledConfig):
    """Samples of a role."""

    counter: str | None = None  # signal that counts the frames of a message without index
    rate_hz: Positive | None = None  # of a signal slower than sampling.rate_hz
    max_hold_ms: Positive | None = None  # between two samples of a slower signal, and after its last
    filter_delay_us: Annotated[float, Field(ge=0, le=500)] = 0.0  # by which all it shows comes late
    lag_us: Annotated[float, Field(ge=0, le=150)] = 0.0  # time constant of a slow sensor, first order
    accuracy_percent: Annotated[float, Field(ge=0, le=5)] = 0.7  # of a pressure sensor's gain, one sigma


class EnergizingConfig(SampledConfig):
    """Samples of the energizing of the injector: with a unit of time its duration, else a level."""

    # from the start of energizing, within which the needle opens
    missing_after_ms: Annotated[float, Field(ge=0.1, le=50)] = 3.0


class SlowSignalConfig(Section):
    """Signal of a message that carries an optional role: one value a frame."""

    message: str
    signal: str
    link: str | None = None  # the bus the message is on, instead of its database's


class SlowQuantityConfig(SlowSignalConfig):
    """Signal of a message that carries an optional role with a unit."""

    unit: str | None = None  # replaces the unit of the bus database


class LearningEnableConfig(SlowSignalConfig):
    timeout_ms: Positive | None = None  # None: ten cycle times of the message


class SurroundingConfig(SlowQuantityConfig):
    timeout_ms: Positive | None = None  # None: ten cycle times of the message


class SignalsConfig(Section):
    rail_pressure: SignalConfig
    needle_lift: SignalConfig | None = None  # without it the needle is known by the energizing alone
    line_pressure: SignalConfig
    learning_enable: LearningEnableConfig | None = None
    measured_mass: SlowQuantityConfig | None = None  # of an injection
    fuel_temperature: SurroundingConfig | None = None  # in the feed line
    chamber_pressure: SurroundingConfig | None = None  # absolute, into which is injected
    energizing: EnergizingConfig | None = None

    @field_validator("rail_pressure")
    @classmethod
    def _no_lag(cls, rail: SignalConfig) -> SignalConfig:
        if rail.lag_us != 0.0:
            raise ValueError(
                "'lag_us' is for needle lift and line pressure; state that of a rail pressure, which changes slowly, "
                "as 'filter_delay_us'"
            )
        return rail

    @field_validator("needle_lift")
    @classmethod
    def _no_accuracy(cls, lift: SignalConfig | None) -> SignalConfig | None:
        if lift is not None and "accuracy_percent" in lift.model_fields_set:
            raise ValueError("'accuracy_percent' is for pressures; leave it out")
        return lift

    @model_validator(mode="after")
    def _tells_of_the_needle(self) -> Self:
        if self.needle_lift is None and self.energizing is None:
            raise ValueError(
                "nothing tells when the needle opens; state [signals.needle_lift], or, where it is not measured, "
                "[signals.energizing]"
            )
        return self

    def of(self, role: Role) -> SignalConfig:
        """The mapping of a role; a lift that is not measured gets that of the line pressure, and is never read."""
        mapping: SignalConfig | None = getattr(self, role.value)
        return mapping or self.line_pressure.model_copy(update=_NO_DELAYS)

    @property
    def optional(self) -> tuple[tuple[OptionalRole, SlowSignalConfig], ...]:
        """The optional roles the bench has, with their mappings."""
        mappings = ((role, getattr(self, role.value)) for role in OptionalRole)
        return tuple((role, mapping) for role, mapping in mappings if mapping is not None)

    @property
    def surroundings(self) -> tuple[OptionalRole, ...]:
        """The optional roles the bench has that change the model, by their names in `Surroundings`."""
        return tuple(role for role, _ in self.optional if role in Surroundings._fields)


def undone_in_alignment(signals: SignalsConfig, role: Role) -> float:
    """Delay [s] by which samples of a role are moved with their message: the lift's, if the message carries it."""
    lift, own = signals.of(Role.NEEDLE_LIFT), signals.of(role)
    together = (own.message, own.link) == (lift.message, lift.link)
    return (lift if together else own).filter_delay_us * MICROSECOND


def effects_after_alignment(signals: SignalsConfig) -> tuple[SizedEffect, ...]:
    """Effects of the delays that are left in aligned samples, and of the lags; () where nothing is stated."""
    rail = signals.rail_pressure.filter_delay_us * MICROSECOND
    remaining = rail - undone_in_alignment(signals, Role.RAIL_PRESSURE)
    return _effects(signals, remaining, signals.line_pressure.filter_delay_us * MICROSECOND)


def effects_on_one_raster(signals: SignalsConfig, location: Callable[[str], str]) -> tuple[SizedEffect, ...]:
    """Effects of delays and lags in recordings that are compared with models, against the lift.

    location: of a key in its file. Raises `UserError` for delays that differ by more than `MOST_APART_US`.
    """
    lift = signals.of(Role.NEEDLE_LIFT).filter_delay_us
    for role in (Role.RAIL_PRESSURE, Role.LINE_PRESSURE):
        apart = abs(signals.of(role).filter_delay_us - lift)
        if apart > MOST_APART_US:
            raise UserError(
                location(f"signals.{role}.filter_delay_us"),
                f"differs by {apart:g} us from the lift's, {lift:g} us; `fit` and `discover` undo {MOST_APART_US:g}",
                "shift the channel in the recording, and leave the key out for these commands",
            )
    rail, line = (each.filter_delay_us - lift for each in (signals.rail_pressure, signals.line_pressure))
    return _effects(signals, rail * MICROSECOND, line * MICROSECOND)


def as_sent(signals: SignalsConfig) -> SignalsConfig:
    """Signals without delays and lags."""
    return _with_changes(signals, lambda _: _NO_DELAYS)


def as_observed(signals: SignalsConfig) -> SignalsConfig:
    """Signals as an observer's evidence has them: only the line pressure is still delayed."""
    return _with_changes(signals, lambda role: {} if role is Role.LINE_PRESSURE else _NO_DELAYS)


def with_exact_sensors(signals: SignalsConfig) -> SignalsConfig:
    """Signals of pressure sensors without an error of the gain, as those of a simulation."""
    return _with_changes(signals, lambda _: {"accuracy_percent": 0.0})


def _with_changes(signals: SignalsConfig, change: Callable[[Role], dict[str, float]]) -> SignalsConfig:
    stated = {role: mapping for role in Role if (mapping := getattr(signals, role.value)) is not None}
    return signals.model_copy(
        update={role.value: mapping.model_copy(update=change(role)) for role, mapping in stated.items()}
    )


def _effects(signals: SignalsConfig, rail_delay: float, line_delay: float) -> tuple[SizedEffect, ...]:
    """Effects of delays [s] against the lift."""
    sizes = (
        ("rail_pressure_skew", "d", rail_delay),
        ("channel_skew", "d", line_delay),
        ("needle_lift_sensor_lag", "tau", signals.of(Role.NEEDLE_LIFT).lag_us * MICROSECOND),
        ("line_pressure_sensor_lag", "tau", signals.line_pressure.lag_us * MICROSECOND),
    )
    return tuple(sized(name, **{key: size}) for name, key, size in sizes if size != 0.0)
