"""Variants of measurements: a free needle, another offset, gain or noise, and several recordings joined to one."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.learning.healthy import Healthy
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.model.effects import sized

PART_GAP = 10e-3  # s between two parts of a recording: no sample belongs to both


def with_free_needle(recordings: Sequence[Measurement]) -> tuple[Measurement, ...]:
    """Recordings for which every model has its own lift, where the lift was not measured."""
    return tuple(replace(one, is_free=one.is_answered) for one in recordings)


def with_healthy_offset(measured: Measurement, healthy: Healthy) -> Measurement:
    """A recording with the offset that its line-pressure sensor had when the injector was healthy."""
    if healthy.line_pressure_offset_MPa == 0.0:
        return measured
    offset = sized("line_pressure_sensor_offset", o=healthy.line_pressure_offset_MPa * MEGAPASCAL)
    return replace(measured, stated=(*measured.stated, offset))


def without_gain(recordings: Sequence[Measurement], gain: float, level: float = 1.0) -> tuple[Measurement, ...]:
    """Recordings in the rail sensor's units. gain: of the line-pressure sensor; level: of measured flows in them."""
    result = []
    for measurement in recordings:
        line, rate = measurement.recording.line_pressure / (1.0 + gain), measurement.recording.injection_rate
        rate = None if rate is None else rate / level
        changed = replace(measurement.recording, line_pressure=line, injection_rate=rate)
        result.append(replace(measurement, recording=changed))
    return tuple(result)


def noisier(measurement: Measurement, seed: int) -> Measurement:
    """The recording with as much noise added as it has: the change of a result shows the uncertainty of it."""
    random, recording, noise = np.random.default_rng(seed), measurement.recording, measurement.noise
    louder: dict[str, Any] = {
        name: getattr(recording, name) + random.normal(0.0, getattr(noise, name), recording.samples)
        for name in ("rail_pressure", "needle_lift", "line_pressure")
    }
    return replace(measurement, recording=replace(recording, **louder))


def joined(parts: Sequence[Mapping[str, NDArray[np.float64]]], sample_rate: float, **of: Any) -> Recording:
    """One recording of the signals of several, by name, with a gap between any two; of: its further fields."""
    gap = np.full(round(PART_GAP * sample_rate), np.nan)
    signals: dict[str, Any] = {
        name: np.concatenate([samples for part in parts for samples in (part[name], gap)]) for name in parts[0]
    }
    return Recording(np.arange(signals["needle_lift"].size) / sample_rate, **signals, **of)
