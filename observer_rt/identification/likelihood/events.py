"""Events of a recording: stretches of samples that are judged, and injections that are left out for a reason."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from observer_rt.engine.estimation.predictor import SETTLE
from observer_rt.engine.observer import Durations
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MICROMETRE, Bools, Floats
from observer_rt.identification.likelihood.openings import Opening, find_openings, ramp_samples
from observer_rt.model.effective import NO_CLOCK, Clock

LEAD = 3e-3  # s before an opening from which x~ runs
COUNTED_LEAD = 1e-3  # s before an opening from which innovations count: by then x~ has forgotten its start
RING_DOWN = 12e-3  # s after the last closing that count
EVENT_GAP = Durations().event_gap  # s of shut needle that end an event
MARGIN = 80e-6  # s at both ends, for channels recorded late or early
LIFT_FLOOR, _GUESSED_LIFT_NOISE = 0.02e-6, 0.4 * MICROMETRE  # m: least noise of a lift, and that of too few samples
SHORTEST_OPENING = 0.05e-3  # s
_ORDER = 4  # differences: what physics does to a signal within four samples is far below the noise
_ORDER_OF_PAIRS = 8  # differences of means of two samples, among which a line rings twice as fast
_FINE_RATE = 80e3  # Hz, from which on pairs of samples are far above the higher waves of a line
_COLOUR_RATIO = 1.25  # times the level by samples, from which on the level by pairs is no chance
_CLIP_SIGMAS = 5.0  # standard deviations beyond which a difference is a kink or a spike
_NORMAL_MEDIAN = 0.6745  # median of |z| of a standard normal z
_ITERATIONS = 20
FEWEST_DIFFERENCES = 200


@dataclass(frozen=True)
class JudgedEvent:
    """Openings closer than EVENT_GAP: x~ runs from sample `start`, innovations count in [counted, end)."""

    openings: tuple[Opening, ...]
    start: int
    counted: int
    end: int
    number: int  # from 1, of all injections of a recording read in one piece, also those that are left out
    clock: Clock = NO_CLOCK  # time and openings of the recording up to `start`

    def moved(self, by: int) -> "JudgedEvent":
        """The event some samples later."""
        openings = tuple(Opening(o.first + by, o.last + by, o.rising, o.falling) for o in self.openings)
        return replace(self, openings=openings, start=self.start + by, counted=self.counted + by, end=self.end + by)


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


def rail_pressure_before(event: JudgedEvent, recording: Recording) -> float:
    """Mean rail pressure before an event [Pa]."""
    first = event.openings[0].first
    lead = max(1, round(COUNTED_LEAD * recording.sample_rate))
    return float(np.mean(recording.rail_pressure[first - lead : first]))


def open_time(event: JudgedEvent, recording: Recording) -> float:
    """Time the needle is open in an event [s]."""
    return sum(o.last - o.first + 1 for o in event.openings) / recording.sample_rate


def missing_samples(recording: Recording) -> Bools:
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
    return max(noise if np.isfinite(noise) else _GUESSED_LIFT_NOISE, LIFT_FLOOR)


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
    for number, (group, limit) in enumerate(zip(groups, limits, strict=True), 1):
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
            events.append(JudgedEvent(tuple(group), start, counted, end, number, clock))
        else:
            left_out.append(LeftOut(float(recording.time[group[0].first]), lack))
        previous_end = group[-1].last
        before += len(group)
    return tuple(events), tuple(left_out)


def shut_mask(recording: Recording, openings: Sequence[Opening]) -> Bools:
    """Samples (n,) at which the needle has been shut for `SETTLE` and more."""
    result = np.ones(recording.samples, np.bool_)
    for opening in openings:
        result[opening.first : opening.last + 1 + round(SETTLE * recording.sample_rate)] = False
    return result


def noise_level(values: Floats, chosen: Bools, sample_rate: float) -> float:
    """Standard deviation of the white noise that is as strong as the signal's at the frequencies of a line's waves.

    An anti-alias filter smooths single samples: noisier means of pairs count, unless slow samples contain ringing.
    """
    by_samples, even = white_noise(values, chosen), values.size // 2 * 2
    pairs = np.where(chosen, values, np.nan)[:even].reshape(-1, 2).mean(axis=1)
    by_pairs = math.sqrt(2.0) * white_noise(pairs, np.isfinite(pairs), _ORDER_OF_PAIRS)
    return by_pairs if sample_rate >= _FINE_RATE and by_pairs > _COLOUR_RATIO * by_samples else by_samples


def white_noise(values: Floats, chosen: Bools, order: int = _ORDER) -> float:
    """Standard deviation of white noise in chosen samples (n,), the clipped one of differences; nan: too few."""
    sizes = np.abs(np.diff(np.where(chosen, values, np.nan), order))
    sizes = sizes[np.isfinite(sizes)]
    if sizes.size < FEWEST_DIFFERENCES:
        return math.nan
    # the median alone would be 1.5 % low on signals of few codes, enough to matter
    sigma = float(np.median(sizes)) / _NORMAL_MEDIAN or float(np.sqrt(np.mean(sizes**2)))
    for _ in range(_ITERATIONS):
        kept = sizes[sizes <= _CLIP_SIGMAS * sigma]
        clipped = float(np.sqrt(np.mean(kept**2))) if kept.size else sigma
        if math.isclose(clipped, sigma, rel_tol=1e-9):
            break
        sigma = clipped
    return sigma / math.sqrt(math.comb(2 * order, order))  # by which they raise white noise
