"""Faults that the input frames themselves show: damage, repetition, many samples lost at once, another rate."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from observer_rt.bus.alignment import LARGEST_DRIFT, MessageTiming
from observer_rt.daemon.input_monitoring.arrivals import Arrivals, WatchedMessage
from observer_rt.daemon.input_monitoring.silence import REPORTED_AFTER
from observer_rt.engine.reports.news import Notice
from observer_rt.engine.service.messages import Counters
from observer_rt.engine.stream.state import Reason
from observer_rt.engine.words import Topic

LOOKS = 10  # the frames of so many looks are judged together
REPORTED_SHARE = 0.005  # of these frames; a larger share with a fault is reported
OUT_OF_SEQUENCE = 0.1  # the same for alive counters, which lost frames disturb, too
LOST_AT_ONCE = 0.1  # s of samples lost from one look to the next
LASTING = 20  # looks with another rate and a contradicted model before it is reported
ENOUGH_FRAMES = 100  # frames whose stamps determine a rate


class _Fault(NamedTuple):
    """A kind of useless frames, by the counter that counts them."""

    counter: str  # field of `Counters`
    meaning: str
    remedy: str
    counts: Callable[[WatchedMessage], bool]  # whether the counter counts frames of a message
    least: float = REPORTED_SHARE


def _is_protected(source: WatchedMessage) -> bool:
    return source.layout.e2e_profile is not None


def _has_samples(source: WatchedMessage) -> bool:
    return bool(source.streams)


_FAULTS = (
    _Fault(
        "crc_errors",
        "have a wrong CRC",
        "the bus is disturbed: check cable, termination and bit rate; if it is all of them, E2EProfile and "
        "E2EDataId of the database",
        _is_protected,
    ),
    _Fault(
        "sequence_errors",
        "have an alive counter that does not count on",
        "is it stuck in the device? do two devices send one identifier?",
        _is_protected,
        OUT_OF_SEQUENCE,
    ),
    _Fault(
        "length_errors",
        "have another length than the database says",
        "correct the database, or the device",
        lambda _: True,
    ),
    _Fault(
        "repeated_frames",
        "come twice, the first of them counts",
        "do two devices send one identifier? does a gateway repeat frames? is an index stuck?",
        _has_samples,
    ),
    _Fault(
        "old_frames",
        "come too late to count",
        "does a bus or gateway lag by more than 4096 samples?",
        _has_samples,
    ),
)


class FrameWatch:
    """Watches the counters: the share of the frames that is useless and why, and samples that are lost at once."""

    def __init__(self, arrivals: Arrivals, rate: float) -> None:
        """rate: of samples [Hz]."""
        self._arrivals = arrivals
        self._names = _names(filter(_has_samples, arrivals.sources))
        self._rate = rate
        self._begin: Counters | None = None  # at the first of the looks judged together
        self._frames: Mapping[WatchedMessage, int] = {}  # received until then
        self._last: Counters | None = None
        self._looks = 0
        self._is_explained = False
        self._reported: set[_Fault] = set()

    def look(self, counters: Counters, is_explained: bool) -> Iterator[Notice]:
        """Notices of a look; is_explained: another watch has already reported why frames are useless."""
        if self._begin is None or self._last is None:
            self._begin = self._last = counters
            self._frames = self._frames_received()
            return
        lost, self._last = counters.lost_samples - self._last.lost_samples, counters
        if LOST_AT_ONCE <= lost / self._rate < REPORTED_AFTER:  # a longer silence is reported by itself
            yield Notice(
                Topic.INPUT,
                f"{self._names}: {lost} samples were lost at once, {lost / self._rate:.2g} s\n"
                "  remedy: check cable and supply of the measuring device; DroppedFrames says if this computer "
                "was too slow",
            )
        self._looks += 1
        self._is_explained |= is_explained
        if self._looks >= LOOKS:
            if not self._is_explained:
                yield from self._judged(counters.since(self._begin))
            self._begin, self._looks, self._is_explained = counters, 0, False
            self._frames = self._frames_received()

    def _frames_received(self) -> Mapping[WatchedMessage, int]:
        return {source: self._arrivals.count_of(source).frames for source in self._arrivals.sources}

    def _judged(self, since_begin: Counters) -> Iterator[Notice]:
        received = {source: now - self._frames[source] for source, now in self._frames_received().items()}
        for fault in _FAULTS:
            counted = [source for source in received if fault.counts(source)]
            frames = sum(received[source] for source in counted)
            if not frames:
                continue
            share, names = getattr(since_begin, fault.counter) / frames, _names(counted)
            if share >= fault.least and fault not in self._reported:
                self._reported.add(fault)
                text = f"{names}: {100 * share:.2g} % of frames {fault.meaning}\n  remedy: {fault.remedy}"
                yield Notice(Topic.INPUT, text)
            elif share == 0.0 and fault in self._reported:
                self._reported.discard(fault)
                yield Notice(Topic.INPUT, f"{names}: no more frames that {fault.meaning}", is_over=True)


def _names(sources: Iterable[WatchedMessage]) -> str:
    return ", ".join(source.text for source in sources)


class RateWatch:
    """Reports the rate that the bench file should state, if samples come at another and the model is contradicted.

    Only then: a recording that is replayed at another speed does not contradict the model.
    """

    def __init__(self, rate: float) -> None:
        """rate: `sampling.rate_hz` of the bench file."""
        self._rate = rate
        self._looks = 0
        self.reported = ""
        """The report in force, with its remedy; empty if there is none."""

    def look(self, timing: Sequence[MessageTiming], reason: Reason) -> Iterator[Notice]:
        """Notices of a look; reason: why the service is not valid."""
        off = [it for it in timing if abs(it.drift) >= LARGEST_DRIFT and it.jitter.frames >= ENOUGH_FRAMES]
        self._looks = self._looks + 1 if off and reason is Reason.MODEL_INADEQUATE else 0
        if not off:
            self.reported = ""
        if self._looks == LASTING and not self.reported:
            actual = self._rate / (1.0 + off[0].drift)
            self.reported = (
                f"{off[0].name}: samples come at {actual:.6g} a second, sampling.rate_hz is {self._rate:g}\n"
                f"  remedy: sampling.rate_hz is likely {float(f'{actual:.3g}'):.9g}; nothing, if a recording is "
                "replayed at another speed"
            )
            yield Notice(Topic.INPUT, self.reported)
