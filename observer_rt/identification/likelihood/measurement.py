"""A recording as it is judged: with its noise, its events, and the reasons for which events are left out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.injector import Meaning
from observer_rt.core.stream.stream import dead_band
from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.estimation.predictor import SETTLE
from observer_rt.engine.observer import Durations
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import Sampled
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MM3_PER_MS
from observer_rt.identification.likelihood.openings import Opening, find_openings, ramp_samples
from observer_rt.identification.likelihood.white_noise import noise_level, white_noise
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effective import NO_CLOCK, Clock, Coefficients, EffectiveModel, averaged

LEAD = 3e-3  # s before an opening from which x~ runs
COUNTED_LEAD = 1e-3  # s before an opening from which innovations count: by then x~ has forgotten its start
RING_DOWN = 12e-3  # s after the last closing that count
EVENT_GAP = Durations().event_gap  # s of shut needle that end an event
START_MEAN = 0.05e-3  # s on either side of the start over which y is averaged
MARGIN = 80e-6  # s at both ends, for channels recorded late or early
FLOOR = NoiseLevels(rail_pressure=0.005 * MEGAPASCAL, line_pressure=0.005 * MEGAPASCAL, needle_lift=0.02e-6)
RATE_FLOOR = 0.01 * MM3_PER_MS
_GUESSED_LIFT_NOISE = 0.4 * MICROMETRE  # where too few samples tell
LOWEST_SAMPLE_RATE = 10e3  # Hz, below which the line mode is not seen
SHORTEST_OPENING = 0.05e-3  # s
APART = 10e-3  # s between two parts of a recording: no sample belongs to both


@dataclass(frozen=True)
class JudgedEvent:
    """Openings closer than EVENT_GAP: x~ runs from sample `start`, innovations count in [counted, end).

    clock: time and openings of the recording up to `start`.
    """

    openings: tuple[Opening, ...]
    start: int
    counted: int
    end: int
    clock: Clock = NO_CLOCK

    def moved(self, by: int) -> "JudgedEvent":
        """The event some samples later."""
        openings = tuple(Opening(o.first + by, o.last + by, o.rising, o.falling) for o in self.openings)
        return JudgedEvent(openings, self.start + by, self.counted + by, self.end + by, self.clock)


class Lack(StrEnum):
    """Reasons for which an injection cannot be judged."""

    GAP = "samples are missing in it or beside it"
    AFTER = f"less than {EVENT_GAP / 2 * 1e3:g} ms of shut needle follow"
    BEFORE = f"less than {LEAD * 1e3:g} ms of shut needle come before"


@dataclass(frozen=True)
class LeftOut:
    """An injection that is not judged; time: when the needle opens [s]."""

    time: float
    lack: Lack


@dataclass(frozen=True)
class FoundInjections:
    """Injections of a recording of so many samples, some of them `missing`.

    complete: injections that can be judged; left_out: others.
    """

    samples: int
    missing: int
    complete: int
    left_out: tuple[LeftOut, ...]


@dataclass(frozen=True, eq=False)
class Measurement:
    """A recording, or the excerpts of a long one, with its noise and events.

    noise: of a sample; rate_noise: of the measured rate [m3/s], nan without one; rail_pressure: mean before
    the events [Pa]; duration: mean time the needle is open in an event [s]; injections: in the whole recording;
    stated: delays and lags of its channels; commands: where the lift was not measured, starts and ends of energizing
    (k, 2) [samples], with the known delays of shots, from which the lift follows; is_free: every model has its own
    lift by these.
    """

    recording: Recording
    noise: NoiseLevels
    rate_noise: float
    events: tuple[JudgedEvent, ...]
    rail_pressure: float
    duration: float
    injections: FoundInjections
    stated: tuple[SizedEffect, ...] = ()
    commands: NDArray[np.float64] | None = None
    is_free: bool = False

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

    def shots_in(self, event: JudgedEvent) -> NDArray[np.int64]:
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
    """Every recording with its noise and events, in the order given.

    Raises `UserError` for a recording without a complete injection, too short a standstill or a slow sample rate.
    """
    results = []
    for recording in recordings:
        refuse_slow(recording)
        openings = openings_of(recording)
        events, left_out = events_of(recording, openings)
        missing = int(np.count_nonzero(missing_samples(recording)))
        injections = FoundInjections(recording.samples, missing, len(events), left_out)
        results.append(measurement_of(recording, openings, events, injections))
    if not results:
        raise UserError("RECORDING", "no recordings", "give at least one recording with injections")
    return tuple(results)


def refuse_slow(recording: Sampled) -> None:
    """Raise `UserError` for a sample rate at which the line's ringing does not show."""
    if recording.sample_rate < LOWEST_SAMPLE_RATE:
        problem = f"{recording.sample_rate:g} samples a second do not show the ringing of the line"
        raise UserError(_name(recording), problem, f"record with {LOWEST_SAMPLE_RATE:g} Hz or more")


def measurement_of(
    recording: Recording, openings: Sequence[Opening], events: tuple[JudgedEvent, ...], injections: FoundInjections
) -> Measurement:
    """A recording with its events, of all openings in it, and its noise. Errors as of `measurements`."""
    if not events:
        refuse_unshut(recording)
        lacks = sorted({str(event.lack) for event in injections.left_out})
        raise UserError(
            _name(recording),
            "no complete injection" + "".join(f"; {lack}" for lack in lacks),
            f"record {LEAD * 1e3:g} ms of shut needle before an injection and {EVENT_GAP * 1e3:g} ms after it",
        )
    pressure = float(np.mean([rail_pressure_before(event, recording) for event in events]))
    duration = float(np.mean([open_time(event, recording) for event in events]))
    return Measurement(recording, *_noise(recording, openings), events, pressure, duration, injections)


def refuse_unshut(recording: Recording) -> None:
    """Raise `UserError` for a lift that the dead band takes for open where the needle is shut."""
    lift = recording.needle_lift[np.isfinite(recording.needle_lift)] / MICROMETRE
    opens, shuts = (level / MICROMETRE for level in dead_band(lift_noise(recording)))
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


def rail_pressure_before(event: JudgedEvent, recording: Recording) -> float:
    """Mean rail pressure before an event [Pa]."""
    first = event.openings[0].first
    lead = max(1, round(COUNTED_LEAD * recording.sample_rate))
    return float(np.mean(recording.rail_pressure[first - lead : first]))


def open_time(event: JudgedEvent, recording: Recording) -> float:
    """Time the needle is open in an event [s]."""
    return sum(o.last - o.first + 1 for o in event.openings) / recording.sample_rate


def missing_samples(recording: Recording) -> NDArray[np.bool_]:
    """Samples (n,) whose inputs or line pressure are not available."""
    return np.isnan(recording.rail_pressure + recording.needle_lift + recording.line_pressure)


def openings_of(recording: Recording) -> list[Opening]:
    """Openings of the needle, found with the lift's own noise."""
    shortest, ramp = SHORTEST_OPENING * recording.sample_rate, ramp_samples(recording.sample_rate)
    openings = find_openings(recording.needle_lift, lift_noise(recording), ramp)
    return [o for o in openings if o.last - o.first >= shortest]


def lift_noise(recording: Recording) -> float:
    """Noise of the lift [m], by which the dead band goes."""
    noise = noise_level(recording.needle_lift, np.ones(recording.samples, np.bool_), recording.sample_rate)
    return max(noise if np.isfinite(noise) else _GUESSED_LIFT_NOISE, FLOOR.needle_lift)


def events_of(
    recording: Recording, openings: Sequence[Opening]
) -> tuple[tuple[JudgedEvent, ...], tuple[LeftOut, ...]]:
    """Complete events whose samples are all available, and the others with their reasons."""
    rate = recording.sample_rate
    groups: list[list[Opening]] = []
    for opening in openings:
        if groups and opening.first - groups[-1][-1].last < EVENT_GAP * rate:
            groups[-1].append(opening)
        else:
            groups.append([opening])
    margin = round(MARGIN * rate) + 1
    lead = round(COUNTED_LEAD * rate)
    limits = [*(group[0].first - lead for group in groups), recording.samples - margin][1:]
    missing = missing_samples(recording)
    events, left_out = [], []
    previous_end, before = 0, 0
    for group, limit in zip(groups, limits, strict=True):
        start = group[0].first - round(LEAD * rate)
        counted = group[0].first - lead
        end = min(group[-1].last + round(RING_DOWN * rate), limit)
        lack = None
        if start - margin < previous_end:
            lack = Lack.BEFORE
        elif end - group[-1].last < 0.5 * EVENT_GAP * rate:
            lack = Lack.AFTER
        elif missing[start - margin : end + margin].any():
            lack = Lack.GAP
        if lack is None:
            clock = Clock(float(recording.time[start]), float(before))
            events.append(JudgedEvent(tuple(group), start, counted, end, clock))
        else:
            left_out.append(LeftOut(float(recording.time[group[0].first]), lack))
        previous_end = group[-1].last
        before += len(group)
    return tuple(events), tuple(left_out)


def _noise(recording: Recording, openings: Sequence[Opening]) -> tuple[NoiseLevels, float]:
    """Noise of pressures and rate while the needle is shut, of the lift while it is open; the rate's comes second."""
    shut = shut_mask(recording, openings)
    is_open = np.zeros(recording.samples, np.bool_)
    for opening in openings:
        is_open[opening.first : opening.last + 1] = True
    rail, line = (
        noise_level(v, shut, recording.sample_rate) for v in (recording.rail_pressure, recording.line_pressure)
    )
    if not np.isfinite(rail + line):
        raise UserError(
            _name(recording), "too little standstill to measure the noise", "record some ms more of shut needle"
        )
    # clipped at 0 it has half its noise there; open it is too short for its colour
    lift = float(np.fmax(white_noise(recording.needle_lift, is_open), lift_noise(recording)))
    levels = NoiseLevels(
        rail_pressure=max(rail, FLOOR.rail_pressure),
        line_pressure=max(line, FLOOR.line_pressure),
        needle_lift=max(lift, FLOOR.needle_lift),
    )
    if recording.injection_rate is None:
        return levels, float("nan")
    return levels, max(noise_level(recording.injection_rate, shut, recording.sample_rate), RATE_FLOOR)


def with_free_needle(recordings: Sequence[Measurement]) -> tuple[Measurement, ...]:
    """Recordings for which every model has its own lift, where the lift was not measured."""
    return tuple(replace(one, is_free=one.is_answered) for one in recordings)


def without_gain(recordings: Sequence[Measurement], gain: float, level: float = 1.0) -> tuple[Measurement, ...]:
    """Recordings in the rail sensor's units. gain: of the line-pressure sensor; level: of measured flows in them."""
    result = []
    for measurement in recordings:
        recording, rate = measurement.recording, measurement.recording.injection_rate
        changed = replace(
            recording,
            line_pressure=recording.line_pressure / (1.0 + gain),
            injection_rate=None if rate is None else rate / level,
        )
        result.append(replace(measurement, recording=changed))
    return tuple(result)


def joined(parts: Sequence[Mapping[str, NDArray[np.float64]]], sample_rate: float, **of: Any) -> Recording:
    """One recording of the signals of several, by name, with a gap between any two; of: its further fields."""
    gap = np.full(round(APART * sample_rate), np.nan)
    signals: dict[str, Any] = {
        name: np.concatenate([samples for part in parts for samples in (part[name], gap)]) for name in parts[0]
    }
    return Recording(np.arange(signals["needle_lift"].size) / sample_rate, **signals, **of)


def shut_mask(recording: Recording, openings: Sequence[Opening]) -> NDArray[np.bool_]:
    """Samples (n,) at which the needle has been shut for `SETTLE` and more."""
    result = np.ones(recording.samples, np.bool_)
    for opening in openings:
        result[opening.first : opening.last + 1 + round(SETTLE * recording.sample_rate)] = False
    return result
