"""Faults shown by the frames of the inputs themselves: damaged, twice, samples lost at once, another rate."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from observer_rt.bus.alignment.timekeeping import LARGEST_DRIFT, MessageTiming
from observer_rt.daemon.input_monitoring.arrivals import WatchedMessage
from observer_rt.daemon.input_monitoring.silence import REPORTED_AFTER
from observer_rt.engine.reports.news import Notice
from observer_rt.engine.service.messages import Counters
from observer_rt.engine.stream.state import Reason
from observer_rt.engine.words import Topic

LOOKS = 10  # whose frames are judged together
LEAST = 0.005  # share of these frames, from which on it is reported
LOST_AT_ONCE = 0.1  # s of samples lost from one look to the next
LASTING = 20  # looks that another rate lasts, while the model is contradicted
ENOUGH_FRAMES = 100  # whose stamps tell a rate


class _Fault(NamedTuple):
    """A counter of frames, what it means, and what to do."""

    counter: str
    meaning: str
    remedy: str


_FAULTS = (
    _Fault(
        "crc_errors",
        "have a wrong CRC",
        "the bus is disturbed: see to cable, termination and bit rate; if it is all of them, E2EProfile and "
        "E2EDataId of the database",
    ),
    _Fault(
        "length_errors", "have another length than the database says", "correct the database, or the device"
    ),
    _Fault(
        "repeated_frames",
        "come twice, the first of them counts",
        "do two devices send one identifier? does a gateway repeat frames? is an index stuck?",
    ),
    _Fault("old_frames", "come too late to count", "does a bus or gateway lag by more than 4096 samples?"),
)


class FrameWatch:
    """Looks at what was counted: which share of the frames is of no use and why, and samples lost at once."""

    def __init__(self, sources: Sequence[WatchedMessage], rate: float) -> None:
        """rate: of samples [Hz]."""
        self._names = ", ".join(source.text for source in sources if source.streams)
        self._rate = rate
        self._begin: Counters | None = None  # of the looks judged together
        self._last: Counters | None = None
        self._looks = 0
        self._is_explained = False
        self._reported: set[_Fault] = set()

    def look(self, counters: Counters, is_explained: bool) -> Iterator[Notice]:
        """Notices; is_explained: it is reported already why frames are of no use."""
        if self._begin is None or self._last is None:
            self._begin = self._last = counters
            return
        lost, self._last = counters.lost_samples - self._last.lost_samples, counters
        if LOST_AT_ONCE <= lost / self._rate < REPORTED_AFTER:  # a longer silence is reported by itself
            yield Notice(
                Topic.INPUT,
                f"{self._names}: {lost} samples were lost at once, {lost / self._rate:.2g} s\n"
                "  remedy: see to cable and supply of the measuring device; DroppedFrames says if this computer "
                "was too slow",
            )
        self._looks += 1
        self._is_explained |= is_explained
        if self._looks >= LOOKS:
            if not self._is_explained:
                yield from self._judged(counters.since(self._begin))
            self._begin, self._looks, self._is_explained = counters, 0, False

    def _judged(self, lately: Counters) -> Iterator[Notice]:
        if not lately.frames:
            return
        for fault in _FAULTS:
            share = getattr(lately, fault.counter) / lately.frames
            if share >= LEAST and fault not in self._reported:
                self._reported.add(fault)
                text = (
                    f"{self._names}: {100 * share:.2g} % of frames {fault.meaning}\n  remedy: {fault.remedy}"
                )
                yield Notice(Topic.INPUT, text)
            elif share == 0.0 and fault in self._reported:
                self._reported.discard(fault)
                text = f"{self._names}: no more frames that {fault.meaning}"
                yield Notice(Topic.INPUT, text, is_over=True)


class RateWatch:
    """Reports the rate that the bench file should state, where the model is contradicted and samples come at another.

    A recording that is replayed at another speed is no contradiction.
    """

    def __init__(self, rate: float) -> None:
        """rate: `sampling.rate_hz` of the bench file."""
        self._rate = rate
        self._looks = 0
        self.reported = ""
        """Last report, with its remedy; empty: there is none."""

    def look(self, timing: Sequence[MessageTiming], reason: Reason) -> Iterator[Notice]:
        """Notices."""
        off = [
            one for one in timing if abs(one.drift) >= LARGEST_DRIFT and one.jitter.frames >= ENOUGH_FRAMES
        ]
        self._looks = self._looks + 1 if off and reason is Reason.MODEL_INADEQUATE else 0
        if not off:
            self.reported = ""
        if self._looks == LASTING and not self.reported:
            came = self._rate / (1.0 + off[0].drift)
            self.reported = (
                f"{off[0].name}: samples come at {came:.6g} a second, sampling.rate_hz is {self._rate:g}\n"
                f"  remedy: sampling.rate_hz is likely {float(f'{came:.3g}'):.9g}; nothing, if a recording is "
                "replayed at another speed"
            )
            yield Notice(Topic.INPUT, self.reported)
