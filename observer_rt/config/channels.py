"""Delays of filters and lags of sensors that a bench file states: where each of them is undone.

For samples of a bus `bus/alignment` undoes the delay of each message that carries the lift or the rail pressure; all
else is given to the model, as effects.
"""

from collections.abc import Callable

from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import Role, SignalsConfig
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MICROSECOND
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import sized

MOST_APART_US = 60.0
_KEYS = {"filter_delay_us", "lag_us"}


def undone_in_alignment(signals: SignalsConfig, role: Role) -> float:
    """Delay [s] by which samples of lift or rail pressure are moved with their message: the lift's, if it has one."""
    lift, own = signals.needle_lift, signals.of(role)
    together = (own.message, own.link) == (lift.message, lift.link)
    return (lift if together else own).filter_delay_us * MICROSECOND


def effects_after_alignment(signals: SignalsConfig) -> tuple[SizedEffect, ...]:
    """Effects of the delays that are left in aligned samples, and of the lags; () where nothing is stated."""
    rail = signals.rail_pressure.filter_delay_us * MICROSECOND
    remaining = rail - undone_in_alignment(signals, Role.RAIL_PRESSURE)
    return _effects(signals, remaining, signals.line_pressure.filter_delay_us * MICROSECOND)


def effects_on_one_raster(fitted: BenchInjector) -> tuple[SizedEffect, ...]:
    """Effects of delays and lags in recordings that are compared with models, on one raster: against the lift.

    Raises `UserError` for a delay that the samples stored beside an injection do not bridge.
    """
    signals = fitted.config.signals
    lift = signals.needle_lift.filter_delay_us
    for role in (Role.RAIL_PRESSURE, Role.LINE_PRESSURE):
        apart = abs(signals.of(role).filter_delay_us - lift)
        if apart > MOST_APART_US:
            raise UserError(
                fitted.location(f"signals.{role}.filter_delay_us"),
                f"differs by {apart:g} us from the lift's, {lift:g} us; `fit` and `discover` undo {MOST_APART_US:g}",
                "shift the channel in the recording, and leave the key out for these commands",
            )
    rail, line = (each.filter_delay_us - lift for each in (signals.rail_pressure, signals.line_pressure))
    return _effects(signals, rail * MICROSECOND, line * MICROSECOND)


def as_sent(signals: SignalsConfig) -> SignalsConfig:
    """Signals without delays and lags."""
    return _changed(signals, lambda _: dict.fromkeys(_KEYS, 0.0))


def as_observed(signals: SignalsConfig) -> SignalsConfig:
    """Signals as an observer's evidence has them: only the line pressure is still delayed."""
    mended = dict.fromkeys(_KEYS, 0.0)
    return _changed(signals, lambda role: {} if role is Role.LINE_PRESSURE else mended)


def _changed(signals: SignalsConfig, change: Callable[[Role], dict[str, float]]) -> SignalsConfig:
    return signals.model_copy(
        update={role.value: signals.of(role).model_copy(update=change(role)) for role in Role}
    )


def _effects(signals: SignalsConfig, rail_delay: float, line_delay: float) -> tuple[SizedEffect, ...]:
    """Effects of delays [s] against the lift."""
    sizes = (
        ("rail_pressure_skew", "d", rail_delay),
        ("channel_skew", "d", line_delay),
        ("needle_lift_sensor_lag", "tau", signals.needle_lift.lag_us * MICROSECOND),
        ("line_pressure_sensor_lag", "tau", signals.line_pressure.lag_us * MICROSECOND),
    )
    return tuple(sized(name, **{key: size}) for name, key, size in sizes if size != 0.0)
