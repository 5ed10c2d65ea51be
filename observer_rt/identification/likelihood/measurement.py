"""Measurements: recordings with noise and events. Rows are the samples of all events, one after another."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from observer_rt.config.injector_sections import Meaning
from observer_rt.core.stream.stream import dead_band
from observer_rt.engine.estimation.predictor import NoiseLevels
from observer_rt.engine.learning.healthy import EventStretch, Healthy, expected
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import Sampled
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MM3_PER_MS, Bools, Floats, Ints
from observer_rt.identification.likelihood import events
from observer_rt.identification.likelihood.events import JudgedEvent, LeftOut
from observer_rt.identification.likelihood.openings import Opening
from observer_rt.model.baseline import HealthyShape
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effective import Coefficients, EffectiveModel, averaged
from observer_rt.model.effects import sized

PRESSURE_FLOOR, RATE_FLOOR = 0.005 * MEGAPASCAL, 0.01 * MM3_PER_MS  # least noise
LOWEST_SAMPLE_RATE = 10e3  # Hz, below which the line mode is not seen
RATE_DELAY = 40e-6  # s after an opening from which a measured rate is judged
MASS_LEAD, MASS_TAIL = 0.15e-3, 0.5e-3  # s beside an event's openings that its mass is summed over
PART_GAP = 10e-3  # s between two parts of a recording: no sample belongs to both


@dataclass(frozen=True)
class FoundInjections:
    """Injections found in a recording."""

    samples: int  # of the recording
    missing: int  # of these samples
    complete: int  # injections that can be judged
    left_out: tuple[LeftOut, ...]  # other injections


@dataclass(frozen=True, eq=False)
class Measurement:
    """A recording, or the excerpts of a long one, with its noise and events."""

    recording: Recording
    noise: NoiseLevels  # of a sample
    rate_noise: float  # of the measured rate [m3/s]; nan: there is none
    events: tuple[JudgedEvent, ...]
    rail_pressure: float  # mean before the events [Pa]
    duration: float  # mean time the needle is open in an event [s]
    injections: FoundInjections  # in the whole recording
    stated: tuple[SizedEffect, ...] = ()  # delays and lags of its channels
    commands: Floats | None = None  # (k, 2) delayed starts and ends [samples]; None: lift measured
    is_free: bool = False  # every model has its own lift by the commands

    @property
    def interval(self) -> float:
        """Sample interval [s]."""
        return 1.0 / self.recording.sample_rate

    @property
    def is_answered(self) -> bool:
        """Whether the lift follows from commands, and was not measured."""
        return self.commands is not None

    @property
    def means(self) -> bool:
        """Whether samples are means over the sample period that ends at their time."""
        return self.recording.meaning is Meaning.MEAN

    @property
    def without_answers(self) -> Recording:
        """The recording as it was measured: without a lift that follows from commands."""
        return self.recording.without_lift() if self.is_answered else self.recording

    def shots_in(self, event: JudgedEvent) -> Ints:
        """Numbers (k,) of the commands that begin in an event."""
        begun = np.empty(0) if self.commands is None else self.commands[:, 0]
        return np.flatnonzero((begun >= event.start) & (begun < event.end))

    def as_recorded(self, model: EffectiveModel) -> EffectiveModel:
        """A model with the stated delays and lags of the channels."""
        for effect in self.stated:
            model = effect.effect.apply(model, effect.values)
        return model

    def coefficients_of(self, model: EffectiveModel) -> Coefficients:
        """Coefficients of a model, averaged over the sample period if the samples are means."""
        return averaged(model.coefficients) if self.means else model.coefficients


def measurements(recordings: Sequence[Recording]) -> tuple[Measurement, ...]:
    """Recordings with noise and events. Raises `UserError` without injection or standstill, or for slow samples."""
    results = []
    for recording in recordings:
        refuse_slow(recording)
        openings = events.openings_of(recording)
        judged, left_out = events.events_of(recording, openings)
        missing = int(np.count_nonzero(events.missing_samples(recording)))
        injections = FoundInjections(recording.samples, missing, len(judged), left_out)
        results.append(measurement_of(recording, openings, judged, injections))
    if not results:
        raise UserError("RECORDING", "no recordings", "give at least one recording with injections")
    return tuple(results)


def refuse_slow(recording: Sampled) -> None:
    """Raise `UserError` for a sample rate at which the line's ringing does not show."""
    if recording.sample_rate < LOWEST_SAMPLE_RATE:
        problem = f"{recording.sample_rate:g} samples a second do not show the ringing of the line"
        raise UserError(_name(recording), problem, f"record with {LOWEST_SAMPLE_RATE:g} Hz or more")


def measurement_of(
    recording: Recording, openings: Sequence[Opening], judged: tuple[JudgedEvent, ...], injections: FoundInjections
) -> Measurement:
    """A recording with its events, of all openings in it, and its noise. Errors as of `measurements`."""
    if not judged:
        refuse_unshut(recording)
        lacks = sorted({str(event.lack) for event in injections.left_out})
        lead, gap = f"{events.LEAD * 1e3:g} ms", f"{events.EVENT_GAP * 1e3:g} ms"
        remedy = f"record {lead} of shut needle before an injection and {gap} after it"
        raise UserError(_name(recording), "no complete injection" + "".join(f"; {lack}" for lack in lacks), remedy)
    pressure = float(np.mean([events.rail_pressure_before(event, recording) for event in judged]))
    duration = float(np.mean([events.open_time(event, recording) for event in judged]))
    return Measurement(recording, *_noise(recording, openings), judged, pressure, duration, injections)


def refuse_unshut(recording: Recording) -> None:
    """Raise `UserError` for a lift that the dead band takes for open where the needle is shut."""
    lift = recording.needle_lift[np.isfinite(recording.needle_lift)] / MICROMETRE
    opens, shuts = (level / MICROMETRE for level in dead_band(events.lift_noise(recording)))
    if not lift.size:
        return
    low, zero, high = np.percentile(lift[lift <= np.min(lift) + 0.1 * np.ptp(lift)], (16, 50, 84))
    if high > shuts:
        raise UserError(
            f"{_name(recording)}, needle_lift",
            f"the lift of the shut needle is {zero:.2g} ± {0.5 * (high - low):.2g} um, which crosses the dead band: "
            f"the needle counts as open above {opens:.2g} um and as shut below {shuts:.2g} um",
            f"subtract the zero (offset = {-zero:.2g} in [recording.needle_lift], in um), or lower the noise",
        )


def _name(recording: Sampled) -> str:
    return str(recording.path) if recording.path is not None else "recording"


def _noise(recording: Recording, openings: Sequence[Opening]) -> tuple[NoiseLevels, float]:
    """Noise of pressures and rate while the needle is shut, of the lift while it is open; the rate's comes second."""
    shut = events.shut_mask(recording, openings)
    is_open = np.zeros(recording.samples, np.bool_)
    for opening in openings:
        is_open[opening.first : opening.last + 1] = True
    rate = recording.sample_rate
    pressures = recording.rail_pressure, recording.line_pressure
    rail, line = (events.noise_level(pressure, shut, rate) for pressure in pressures)
    if not np.isfinite(rail + line):
        problem = "too little standstill to measure the noise"
        raise UserError(_name(recording), problem, "record some ms more of shut needle")
    # clipped at 0 it has half its noise there; open it is too short for its colour
    lift = float(np.fmax(events.white_noise(recording.needle_lift, is_open), events.lift_noise(recording)))
    levels = NoiseLevels(max(rail, PRESSURE_FLOOR), max(line, PRESSURE_FLOOR), lift)
    if recording.injection_rate is None:
        return levels, float("nan")
    return levels, max(events.noise_level(recording.injection_rate, shut, rate), RATE_FLOOR)


def in_mass_window(measurement: Measurement, event: JudgedEvent, samples: Ints) -> Bools:
    """Selects the samples (n,) of a recording over which an event's mass is summed."""
    lead, tail = (round(t / measurement.interval) for t in (MASS_LEAD, MASS_TAIL))
    inside = np.zeros(samples.size, np.bool_)
    for opening in event.openings:
        inside |= (samples >= opening.first - lead) & (samples <= opening.last + tail)
    return inside


class Rows:
    """Rows of a batch that hold the samples of a recording."""

    def __init__(self, measurement: Measurement) -> None:
        events = measurement.events
        self.samples = np.concatenate([np.arange(e.start, e.end) for e in events])
        """(n,): the sample whose line pressure a row holds."""
        self.bounds = np.concatenate(([0], np.cumsum([e.end - e.start for e in events])))
        self.counted = np.concatenate([np.arange(e.start, e.end) >= e.counted for e in events])
        """(n,): rows whose innovation is judged."""
        self.counted_bounds = np.concatenate(([0], np.cumsum([e.end - e.counted for e in events])))
        """(events + 1,): event i has the judged rows from counted_bounds[i] to counted_bounds[i + 1]."""
        skipped = round(RATE_DELAY * measurement.recording.sample_rate)
        near = np.zeros(self.samples.size, np.bool_)
        for event, bound in zip(events, self.bounds, strict=False):
            for opening in event.openings:
                end = opening.last + 1 - int(measurement.means)
                near[bound + opening.first - event.start + skipped : bound + end - event.start] = True
        self.rate_rows = np.flatnonzero(near)
        """(m,): rows at which a measured rate is judged, if the line pressure is not late.

        They begin RATE_DELAY after the opening: how the sac begins to fill is uncertain, by the lift's noise and
        an orifice law that is smooth at low pressure. The mean in which the needle shuts does not count.
        """
        self.rate_samples = self.samples[self.rate_rows]
        self._injecting = np.concatenate([in_mass_window(measurement, e, np.arange(e.start, e.end)) for e in events])
        self._interval = measurement.interval

    def volumes(self, rate: Floats) -> Floats:
        """Volume of every event (w,) [m3] by the injection rate (n,) [m3/s] of its rows."""
        return np.add.reduceat(np.where(self._injecting, rate, 0.0), self.bounds[:-1]) * self._interval


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


def joined(parts: Sequence[Mapping[str, Floats]], sample_rate: float, **of: Any) -> Recording:
    """One recording of the signals of several, by name, with a gap between any two; of: its further fields."""
    gap = np.full(round(PART_GAP * sample_rate), np.nan)
    signals: dict[str, Any] = {
        name: np.concatenate([samples for part in parts for samples in (part[name], gap)]) for name in parts[0]
    }
    return Recording(np.arange(signals["needle_lift"].size) / sample_rate, **signals, **of)


def stretches(measurement: Measurement) -> tuple[EventStretch, ...]:
    """Every event as a stretch of judged samples, with edges where the ramps of the lift meet 0."""
    return tuple(
        EventStretch(event.end - event.counted, measurement.interval, measurement.rail_pressure, _edges(event))
        for event in measurement.events
    )


def expected_of(shape: HealthyShape, measurement: Measurement) -> Floats:
    """Mean innovation [Pa] of a healthy injector at the counted samples (n,) of a recording."""
    return np.concatenate([expected(shape, stretch) for stretch in stretches(measurement)])


def _edges(event: JudgedEvent) -> tuple[tuple[float, float], ...]:
    edges = []
    for opening in event.openings:
        opens, shuts = float(opening.first), float(opening.last)
        if opening.rising.slope > 0.0:
            opens -= opening.rising.lift / opening.rising.slope
        if opening.falling.slope > 0.0:
            shuts += opening.falling.lift / opening.falling.slope
        edges.append((opens - event.counted, shuts - event.counted))
    return tuple(edges)
