"""Measurements: recordings with their noise and events, and the refusal of recordings that cannot be judged."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.injector_sections import Meaning
from observer_rt.core.stream.stream import dead_band
from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import Sampled
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MM3_PER_MS
from observer_rt.identification.likelihood.events import (
    EVENT_GAP,
    LEAD,
    JudgedEvent,
    LeftOut,
    events_of,
    lift_noise,
    missing_samples,
    open_time,
    openings_of,
    rail_pressure_before,
    shut_mask,
)
from observer_rt.identification.likelihood.openings import Opening
from observer_rt.identification.likelihood.white_noise import noise_level, white_noise
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effective import Coefficients, EffectiveModel, averaged

PRESSURE_FLOOR, RATE_FLOOR = 0.005 * MEGAPASCAL, 0.01 * MM3_PER_MS  # least noise
LOWEST_SAMPLE_RATE = 10e3  # Hz, below which the line mode is not seen


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
    commands: NDArray[np.float64] | None = None  # (k, 2) delayed starts and ends [samples]; None: lift measured
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


def _noise(recording: Recording, openings: Sequence[Opening]) -> tuple[NoiseLevels, float]:
    """Noise of pressures and rate while the needle is shut, of the lift while it is open; the rate's comes second."""
    shut = shut_mask(recording, openings)
    is_open = np.zeros(recording.samples, np.bool_)
    for opening in openings:
        is_open[opening.first : opening.last + 1] = True
    rate = recording.sample_rate
    rail, line = (noise_level(signal, shut, rate) for signal in (recording.rail_pressure, recording.line_pressure))
    if not np.isfinite(rail + line):
        problem = "too little standstill to measure the noise"
        raise UserError(_name(recording), problem, "record some ms more of shut needle")
    # clipped at 0 it has half its noise there; open it is too short for its colour
    lift = float(np.fmax(white_noise(recording.needle_lift, is_open), lift_noise(recording)))
    levels = NoiseLevels(max(rail, PRESSURE_FLOOR), max(line, PRESSURE_FLOOR), lift)
    if recording.injection_rate is None:
        return levels, float("nan")
    return levels, max(noise_level(recording.injection_rate, shut, rate), RATE_FLOOR)
