"""One recording of an injector: even time grid, three inputs, and the measured rate where there is one."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.recording import Meaning
from observer_rt.foundation.errors import UserError
from observer_rt.recording.signals.time_grid import find_uneven_time, sample_rate_of

TRUTH_SUFFIX = ".truth.csv"  # added to the name of a simulated recording: what nobody could measure
EQUIDISTANT = (
    "a recording must be equidistant: cut it at the gap, resample it on an even grid, or describe it in [recording] "
    "of a bench file, which bridges and splits"
)


class Sampled(Protocol):
    """What was recorded somewhere at a sample rate: a recording, or the file of one that is read in parts."""

    @property
    def path(self) -> Path | None:
        """Where it was read from; None for one made in memory."""

    @property
    def sample_rate(self) -> float:
        """Of every signal [Hz]."""

    @property
    def meaning(self) -> Meaning | None:
        """What a sample is; None: as the bench file says, without one an instant."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Signals of one recording, SI units, every array float64 of shape (n,), n >= 2.

    NaN in a signal means "not available". Raises `UserError` when the arrays differ in length, a signal holds
    an infinite value or `time` is not an even, rising grid.
    """

    time: NDArray[np.float64]
    """[s]"""
    rail_pressure: NDArray[np.float64]
    """[Pa]"""
    needle_lift: NDArray[np.float64]
    """[m]"""
    line_pressure: NDArray[np.float64]
    """[Pa]"""
    injection_rate: NDArray[np.float64] | None = None
    """Measured [m3/s]; None where no rate was measured."""
    path: Path | None = None
    """Where the recording was read from; None for one made in memory."""
    meaning: Meaning | None = field(default=None, kw_only=True)
    """What a sample is; None: as the bench file says, without one an instant."""

    def __post_init__(self) -> None:
        name = str(self.path) if self.path is not None else "recording"
        for signal, values in self.signals.items():
            if values.shape != self.time.shape:
                raise UserError(
                    f"{name}, {signal}",
                    f"{values.size} samples, but the time has {self.time.size}",
                    "give every signal one value for each time stamp (NaN where there is none)",
                )
        check_samples(self.time, self.signals, lambda row: f"{name}, sample {row}")

    @property
    def signals(self) -> dict[str, NDArray[np.float64]]:
        """The signals by name, without time and without a rate that was not measured."""
        signals = {
            "rail_pressure": self.rail_pressure,
            "needle_lift": self.needle_lift,
            "line_pressure": self.line_pressure,
        }
        if self.injection_rate is not None:
            signals["injection_rate"] = self.injection_rate
        return signals

    @property
    def samples(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    @cached_property
    def sample_rate(self) -> float:
        """Sample rate [Hz], exact although printed time stamps are rounded."""
        return sample_rate_of(self.time)


@dataclass(frozen=True, eq=False)
class Chunk(Recording):
    """Samples of a recording that follow one another, be it one alone: its grid was checked as a whole.

    rate: sample rate [Hz]; stretch, first: number of its stretch, and of its first sample therein.
    """

    rate: float = 0.0
    stretch: int = 0
    first: int = 0

    def __post_init__(self) -> None:
        """Nothing: whoever reads a recording in parts has checked it."""

    @property
    def sample_rate(self) -> float:
        """As of the recording."""
        return self.rate


def check_samples(
    time: NDArray[np.float64],
    signals: dict[str, NDArray[np.float64]],
    place_of_row: Callable[[int], str],
) -> None:
    """Check an even time [s] and finite-or-NaN signals, all of shape (n,).

    `place_of_row` turns a zero-based row into what a user finds it by: a line of a file, a sample number.
    Raises `UserError` for the first violation.
    """
    if time.size < 2:
        problem = "holds no sample" if not time.size else "holds one sample only"
        raise UserError(place_of_row(0), problem, "record, or select, at least two samples")
    uneven = find_uneven_time(time)
    if uneven is not None:
        raise UserError(
            place_of_row(uneven.row),
            uneven.problem,
            EQUIDISTANT,
        )
    refuse_infinite(signals, place_of_row)


def refuse_infinite(signals: Mapping[str, NDArray[np.float64]], place_of_row: Callable[[int], str]) -> None:
    """Raise `UserError` for the first infinite value; arguments as of `check_samples`."""
    for signal, values in signals.items():
        infinite = np.flatnonzero(np.isinf(values))
        if infinite.size:
            raise UserError(
                place_of_row(int(infinite[0])),
                f"{signal} is infinite",
                "write NaN, or leave the cell empty, where a value is not available",
            )
