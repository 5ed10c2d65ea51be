"""Faults of sensors, cables, amplifiers and converters: small ones that are always there, large ones for a while."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.random import Generator

from tests.plants import filters, plant
from tests.plants.arrays import Array
from tests.plants.plant import LIFT, LIFT_NOISE, LINE, LINE_NOISE, RAIL, RAIL_NOISE, SIGNALS, Signals
from tools.benchmarks.cases import sign
from tools.benchmarks.faults import reasons as of
from tools.benchmarks.faults.fault import KHZ, US, Part, SensorFault, Stated, Where

NOISE = {RAIL: RAIL_NOISE, LIFT: LIFT_NOISE, LINE: LINE_NOISE}  # of the plant, per sample
FULL_LIFT = 300e-6  # m
REFERENCE = 100e6  # Pa, at which a lift with crosstalk of the whole pressure was set to 0
CREEP, CREEP_TIME = 3e-3, 15e-3  # s: how fast it comes while open, and goes
LIFT_SPIKE = 20e-6 / 3e6  # m of a spike on the lift per Pa of one on a pressure
BURST = 2e-3  # s
_LOWEST = {RAIL: plant.PRESSURE_FLOOR, LINE: plant.PRESSURE_FLOOR, LIFT: plant.LIFT_FLOOR}
_STEPS = {RAIL: plant.PRESSURE_STEP, LINE: plant.PRESSURE_STEP, LIFT: plant.LIFT_STEP}
SPAN = {role: plant.HIGHEST_CODE * step for role, step in _STEPS.items()}
"""What the bus can carry, from the lowest value to the highest."""

Wave = Callable[[Array, Array, float, Generator], Array]
"""What becomes of a signal (n,): of its times [s], values, a size in SI, and chance."""


def on(wave: Wave, *roles: str) -> Callable[[Part], Signals]:
    """The change of some signals by a wave each."""

    def change(part: Part) -> Signals:
        time = part.seen.time
        signals = {role: wave(time, getattr(part.seen, role), part.size, part.chance) for role in roles}
        return replace(part.seen, **signals)

    return change


def adding(role: str, added: Callable[[Part], Array]) -> Callable[[Part], Signals]:
    """The change of one signal by what all signals and the current add to it."""
    return lambda part: replace(part.seen, **{role: getattr(part.seen, role) + added(part)})


def hum(frequency: float) -> Wave:
    """A sinusoid [Hz] of the size as amplitude, its phase by chance."""
    return lambda t, v, size, rng: v + size * np.sin(2.0 * math.pi * (frequency * t + rng.random()))


def _coloured(knee: float) -> Wave:
    return lambda t, v, size, rng: v + filters.coloured_noise(rng.normal(0.0, size, t.size), float(t[1] - t[0]), knee)


def _pink(time: Array, values: Array, size: float, rng: Generator) -> Array:
    frequency = np.fft.rfftfreq(time.size, float(time[1] - time[0]))
    shape = np.where(frequency >= 2.0, 1.0 / np.sqrt(np.maximum(frequency, 2.0)), 0.0)
    noise = np.fft.irfft(shape * np.fft.rfft(rng.normal(size=time.size)), time.size)
    return values + np.asarray(size * noise / np.std(noise), np.float64)


def louder(*roles: str, since: float = 0.0) -> Callable[[Part], Signals]:
    """Noise of the plant's kind, `size` times it together with it, from a share of the time on."""

    def change(part: Part) -> Signals:
        is_there = np.arange(part.seen.time.size) >= since * part.seen.time.size
        extra = math.sqrt(part.size**2 - 1.0) * part.chance.normal(size=(len(roles), is_there.size))
        signals = {r: getattr(part.seen, r) + NOISE[r] * e * is_there for r, e in zip(roles, extra, strict=True)}
        return replace(part.seen, **signals)

    return change


def _at_moments(rate: float, length: Callable[[float, float, Generator], int], put: Any) -> Wave:
    """Stretches at random moments [1/s]; length: of size, sample interval and chance; put: the values there."""

    def wave(time: Array, values: Array, size: float, rng: Generator) -> Array:
        changed, interval = values.copy(), float(time[1] - time[0])
        for first in rng.integers(0, time.size, rng.poisson(rate * (time[-1] - time[0]))):
            part = changed[first : first + length(size, interval, rng)]
            part[:] = put(part, size, rng)
        return changed

    return wave


_spikes = _at_moments(40.0, lambda _, __, rng: int(rng.integers(1, 4)), lambda v, size, rng: v + sign(rng) * size)
_many_spikes = _at_moments(400.0, lambda *_: 1, lambda part, size, rng: part + sign(rng) * size)
_bursts = _at_moments(8.0, lambda _, dt, __: round(BURST / dt), lambda v, size, rng: v + rng.normal(0, size, v.size))


def dropouts(share: float) -> Callable[[Part], Signals]:
    """All signals at a share of their range for `size` samples, now and then."""

    def wave(role: str) -> Wave:
        level = share * (_LOWEST[role] + SPAN[role])
        return _at_moments(20.0, lambda size, *_: round(size), lambda *_: level)

    def change(part: Part) -> Signals:
        for role in SIGNALS:
            part = replace(part, seen=on(wave(role), role)(part))
        return part.seen

    return change


def edge_spikes(*roles: str) -> Callable[[Part], Signals]:
    """Spikes of the size, on the lift in proportion, of 1 to 3 samples at every edge of the energizing."""

    def change(part: Part) -> Signals:
        signals = {role: getattr(part.seen, role).copy() for role in roles}
        for first in np.flatnonzero(np.diff(part.current)) + 1:
            length, way = int(part.chance.integers(1, 4)), sign(part.chance)
            for role, values in signals.items():
                values[first : first + length] += way * part.size * (LIFT_SPIKE if role == LIFT else 1.0)
        return replace(part.seen, **signals)

    return change


def _curved(time: Array, values: Array, size: float, rng: Generator) -> Array:
    share = values / FULL_LIFT
    return values + sign(rng) * size * FULL_LIFT * 4.0 * share * (1.0 - share)


def _creep(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """After an opening the zero is off by up to `size`, and comes back slowly."""
    interval = float(time[1] - time[0])
    seen = filters.filtered(values / FULL_LIFT, interval, filters.first_order(1.0 / (2.0 * math.pi * CREEP_TIME)))
    return values + sign(rng) * size * np.minimum(seen * CREEP_TIME / CREEP, 1.0)


def _coarse(time: Array, values: Array, size: float, rng: Generator) -> Array:
    return np.asarray(size * np.rint(values / size), np.float64)


def few_bits(part: Part) -> Signals:
    pressures = on(_coarse, RAIL, LINE)(replace(part, size=250e6 / 2.0**part.size))
    return on(_coarse, LIFT)(replace(part, seen=pressures, size=500e-6 / 2.0**part.size))


def through(response_of: Callable[[float], filters.Response]) -> Wave:
    """A signal through a filter, whose corner is the size [Hz]."""
    return lambda t, v, size, rng: filters.filtered(v, float(t[1] - t[0]), response_of(size))


def jitter(part: Part) -> Signals:
    """All channels are sampled at moments `size` (one sigma) off."""
    time = part.seen.time
    moments = time + part.chance.normal(0.0, part.size, time.size)
    return replace(part.seen, **{r: np.interp(moments, time, getattr(part.seen, r)) for r in SIGNALS})


def _delay(role: str, value_of: Callable[[float], float], key: str = "filter_delay_us") -> Callable[[float], Stated]:
    """What the bench file says of a size [us]."""
    return lambda size: {role: {key: value_of(size)}}


def _small(name: str, unit: str, sizes: tuple[float, ...], change: Any, reasons: Any, **more: Any) -> Any:
    """A row for a small fault that is always there."""
    return SensorFault(name, Where.SENSOR, reasons, unit, sizes, True, change=change, **more)


def _small_ones() -> list[SensorFault]:
    s, corners = of.SENSOR, (10.0, 20.0, 40.0)
    lp2, lp4 = (through(partial(filters.butterworth, order)) for order in (2, 4))
    rows = [
        SensorFault("none", Where.SENSOR, of.HARMLESS, lasting=True),
        _small("hum_50_hz_line", "MPa", (0.1, 0.2, 0.5), on(hum(50.0), LINE), s),
        _small("hum_150_hz_line", "MPa", (0.1, 0.3), on(hum(150.0), LINE), s),
        _small("hum_50_hz_rail", "MPa", (0.1, 0.3), on(hum(50.0), RAIL), s),
        _small("hum_150_hz_rail", "MPa", (0.1, 0.3), on(hum(150.0), RAIL), s),
        _small("hum_50_hz_lift", "um", (1.0, 3.0), on(hum(50.0), LIFT), s),
        _small("coloured_300_hz_line", "MPa", (0.1, 0.2), on(_coloured(300.0), LINE), s),
        _small("coloured_3_khz_line", "MPa", (0.1, 0.2, 0.4), on(_coloured(3e3), LINE), s),
        _small("coloured_10_khz_line", "MPa", (0.2, 0.4), on(_coloured(1e4), LINE), s),
        _small("coloured_300_hz_rail", "MPa", (0.1, 0.2), on(_coloured(300.0), RAIL), s),
        _small("coloured_3_khz_rail", "MPa", (0.1, 0.2), on(_coloured(3e3), RAIL), s),
        _small("coloured_3_khz_lift", "um", (0.4, 1.0), on(_coloured(3e3), LIFT), s),
        _small("pink_line", "MPa", (0.1, 0.2), on(_pink, LINE), s),
        _small("pink_rail", "MPa", (0.1, 0.2), on(_pink, RAIL), s),
        _small("noise", "times", (2.0, 3.0, 5.0), louder(*SIGNALS), of.HARMLESS),
        _small("noise_line", "times", (3.0, 6.0), louder(LINE), of.HARMLESS),
        _small("noise_rail", "times", (3.0, 6.0), louder(RAIL), of.HARMLESS),
        _small("noise_lift", "times", (3.0, 6.0), louder(LIFT), s),
        _small("noise_from_half_way", "times", (2.0, 3.0), louder(*SIGNALS, since=0.5), of.HARMLESS),
        _small("noise_bursts_line", "MPa", (0.5, 1.5), on(_bursts, LINE), of.OUTLIERS),
        _small("lift_zero_sine", "um, 1.5 Hz", (1.0, 3.0, 8.0), on(hum(1.5), LIFT), of.LIFT_ZERO),
        _small("lift_zero_ramp", "um/s", (2.0, 10.0),
            on(lambda t, v, size, rng: v + sign(rng) * size * (t - t[0]), LIFT), of.LIFT_ZERO),
        _small("lift_creep", "um", (1.0, 3.0), on(_creep, LIFT), of.LIFT_ZERO),
        _small(
            "lift_filter", "kHz", (20.0, 10.0, 5.0, 3.0), on(through(filters.first_order), LIFT), of.LATE_LIFT,
            stated=_delay(LIFT, lambda corner: 1.0 / (2.0 * math.pi * corner * KHZ) / US, "lag_us"),
        ),
        _small("lift_gain_drift", "%", (1.0, 3.0),
            on(lambda t, v, size, rng: v * (1.0 + sign(rng) * size * t / t[-1]), LIFT), s),
        _small("lift_curved", "%", (1.0, 3.0), on(_curved, LIFT), s),
        _small(
            "lift_crosstalk", "um per 10 MPa", (0.5, 1.5, 3.0),
            adding(LIFT, lambda p: p.size / 10e6 * (p.seen.line_pressure - p.seen.rail_pressure)), of.LIFT_ZERO,
        ),
        _small(
            "lift_crosstalk_whole", "um per 10 MPa", (0.5, 1.5),
            adding(LIFT, lambda p: p.size / 10e6 * (p.seen.line_pressure - REFERENCE)), of.LIFT_ZERO,
        ),
        _small("lift_coarse", "um", (1.0, 3.0), on(_coarse, LIFT), s, after_noise=True),
        _small("spikes_at_edges", "MPa", (1.0, 3.0, 10.0), edge_spikes(*SIGNALS), of.OUTLIERS),
        _small("spikes_at_edges_line", "MPa", (3.0,), edge_spikes(LINE), of.OUTLIERS),
        _small("spikes_at_edges_lift", "MPa, 20 um per 3", (3.0,), edge_spikes(LIFT), of.OUTLIERS),
        _small("spikes_line", "MPa", (3.0, 10.0), on(_spikes, LINE), of.OUTLIERS),
        _small("spikes_rail", "MPa", (3.0, 10.0), on(_spikes, RAIL), of.OUTLIERS),
        _small("spikes_lift", "um", (20.0, 60.0), on(_spikes, LIFT), of.OUTLIERS),
        _small("dropouts_to_zero", "samples", (2.0, 5.0), dropouts(0.0), of.DROPOUTS, after_noise=True),
        _small("dropouts_to_full_scale", "samples", (2.0, 5.0), dropouts(1.0), of.DROPOUTS, after_noise=True),
        _small(
            "line_clipped_at_the_top", "MPa", (1.0, 4.0),
            on(lambda t, v, size, rng: np.minimum(v, v.max() - size), LINE), of.CLIPPED,
        ),
        _small(
            "line_clipped_at_the_bottom", "MPa", (1.0, 4.0),
            on(lambda t, v, size, rng: np.maximum(v, v.min() + size), LINE), of.CLIPPED,
        ),
        _small("energizing_on_line", "MPa", (0.1, 0.3), adding(LINE, lambda p: p.size * p.current), of.COIL),
        _small("energizing_on_lift", "um", (1.0, 3.0), adding(LIFT, lambda p: p.size * p.current), s),
        _small("anti_alias_2_all", "kHz", corners, on(lp2, *SIGNALS), of.HARMLESS),
        _small("anti_alias_4_all", "kHz", corners, on(lp4, *SIGNALS), of.HARMLESS),
        _small("anti_alias_2_all_with_noise", "kHz", corners, on(lp2, *SIGNALS), of.HARMLESS, after_noise=True),
        _small("resonance_line", "kHz", (25.0, 40.0), on(through(filters.resonance), LINE), s),
        _small("jitter", "us", (0.5, 2.0), jitter, of.LATE),
        _small("lift_zero_step", "um", (2.0, 6.0), on(lambda t, v, size, rng: v + np.where(
            t >= 0.5 * t[-1], sign(rng) * size, 0.0), LIFT), of.LIFT_ZERO | of.CHANGE),
        _small("few_bits", "bits", (12.0, 10.0), few_bits, of.HARMLESS, after_noise=True),
    ]  # fmt: skip
    for role, name, reasons in ((RAIL, "rail", of.LATE), (LIFT, "lift", of.LATE_LIFT), (LINE, "line", of.LATE_LINE)):
        held, rate = of.FROZEN, 200.0 if role == LIFT else 40.0
        often = _at_moments(rate, lambda size, dt, _: round(size / dt), lambda part, size, rng: part[0])
        rows += [
            _small(f"frozen_samples_{name}", "ms", (0.2, 0.5), on(often, role), held, after_noise=True),
            _small(f"held_{name}", "ms", (0.1, 0.2, 0.5), on(often, role), held),
            _small(f"late_{name}", "us", (10.0, 20.0),
                on(lambda t, v, size, rng: np.interp(t - size, t, v), role), reasons, stated=_delay(role, float)),
            _small(f"anti_alias_2_{name}", "kHz", corners, on(lp2, role), reasons,
                stated=_delay(role, lambda f: filters.butterworth_delay(2, f * KHZ) / US)),
            _small(f"anti_alias_2_{name}_with_noise", "kHz", corners[1:], on(lp2, role), reasons, after_noise=True),
        ]  # fmt: skip
        if role != LIFT:
            rows += [
                _small(f"offset_drift_{name}", "MPa, 0.4 Hz", (0.1, 0.3, 1.0), on(hum(0.4), role), of.OFFSET),
                _small(f"gain_{name}", "%", (0.5, 1.0, 2.0),
                    on(lambda t, v, size, rng: v * (1.0 + sign(rng) * size), role), of.OFFSET),
            ]  # fmt: skip
    return rows


def swapped(sources: Mapping[str, tuple[str, float]]) -> Callable[[Part], Signals]:
    """Each of some signals is another one, or itself, times a factor."""
    return lambda part: replace(
        part.seen, **{role: factor * getattr(part.seen, other) for role, (other, factor) in sources.items()}
    )


def _square(role: str) -> Wave:
    """Between the lowest value and a share of the range, 60 times a second."""
    low, high = _LOWEST[role], _LOWEST[role] + SPAN[role]
    return lambda t, v, size, rng: np.where(np.sin(2 * math.pi * 60.0 * t + rng.random()) > 0.0, size * high, low)


def _of_range(role: str, share: Wave) -> Wave:
    """A share of the range from the lowest value on, whatever the signal is."""
    return lambda *signal: _LOWEST[role] + SPAN[role] * share(*signal)


def _floating(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """A cable that is off hears the mains."""
    mains = 0.5 * (1.0 + np.sin(2 * math.pi * (50.0 * time + rng.random())))
    return np.asarray(size * (mains + 1e-3 * rng.normal(size=time.size)))


def _wandering(time: Array, values: Array, size: float, rng: Generator) -> Array:
    return np.abs((np.cumsum(0.02 * size * rng.normal(size=time.size)) + size) % (2 * size) - size)


def _only_noise(role: str) -> Wave:
    return lambda t, v, size, rng: SPAN[role] * size * rng.normal(size=v.size)


def _large_ones() -> list[SensorFault]:
    """Faults that come and go, of any signal, in any size."""
    rows = []
    for role, name in ((RAIL, "rail"), (LIFT, "lift"), (LINE, "line")):
        unit, sizes = ("um", (3.0, 10.0, 30.0)) if role == LIFT else ("MPa", (0.5, 1.5, 4.0))
        spike, factors = (40.0, (1e3, 1e-3)) if role == LIFT else (20.0, (10.0, 0.1))
        # where the lift does not show that the needle opens, the falling pressure must
        late, alien = (0.1e-3 if role == LIFT else 0.0), (1.0, 5.0, 30.0, 100.0)
        shapes: tuple[tuple[str, str, tuple[float, ...], Wave, frozenset[str]], ...] = (
            ("dead", "", (0.0,), lambda t, v, size, rng: np.zeros_like(v), of.GONE),
            ("unavailable", "", (0.0,), lambda t, v, size, rng: np.full_like(v, np.nan), of.GONE),
            ("unavailable_now_and_then", "", (0.0,), lambda t, v, size, rng: np.where(
                np.sin(2 * math.pi * (50.0 * t + rng.random())) <= 0.5, v, np.nan), of.GONE),
            ("frozen", "", (0.0,), lambda t, v, size, rng: np.full_like(v, v[0]), of.GONE),
            ("drift", unit, sizes, lambda t, v, size, rng: v + sign(rng) * size * np.bartlett(v.size), of.GONE),
            ("step", unit, sizes, lambda t, v, size, rng: v + sign(rng) * size, of.GONE),
            ("many_spikes", unit, (spike,), _many_spikes, of.GONE),
            ("unit", "times", factors, lambda t, v, size, rng: v * size, of.GONE),
            ("gain_step", "times", (0.9, 2.0), lambda t, v, size, rng: v * size, of.GONE),
            ("clipped", "%", (60.0, 80.0, 97.0), lambda t, v, size, rng: np.minimum(v, size * v.max()), of.GONE),
            ("lag", "us", (30.0, 100.0, 300.0),
                through(lambda lag: filters.first_order(1.0 / (2.0 * math.pi * lag))), of.SLOW),
            ("floating", "%", alien, _of_range(role, _floating), of.GONE),
            ("wandering", "%", alien, _of_range(role, _wandering), of.GONE),
            ("square", "%", alien, _square(role), of.GONE),
            ("only_noise", "%", alien, _only_noise(role), of.GONE),
        )  # fmt: skip
        rows += [
            SensorFault(
                f"{shape}_{name}", Where.SENSOR, reasons, its_unit, its_sizes,
                late=late if shape == "lag" else 0.0, change=on(wave, role), after_noise=True,
            )
            for shape, its_unit, its_sizes, wave, reasons in shapes
        ]  # fmt: skip
    swaps = {
        "swapped_pressures": {RAIL: (LINE, 1.0), LINE: (RAIL, 1.0)},
        "swapped_lift_and_line": {LIFT: (LINE, 1e-12), LINE: (LIFT, 1e12)},
        "both_pressures_in_bar": {RAIL: (RAIL, 0.1), LINE: (LINE, 0.1)},
    }
    return rows + [
        SensorFault(name, Where.SENSOR, of.GONE, change=swapped(swap), after_noise=True)
        for name, swap in swaps.items()
    ]


ROWS = (*_small_ones(), *_large_ones())
