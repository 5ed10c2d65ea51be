"""Messages that stay away, or come and cannot be used, as news: once when it begins, once when it is over."""

from dataclasses import dataclass

from observer_rt.service.watch.arrivals import SECOND, Arrivals, WatchedMessage
from observer_rt.service.watch.finding import WatchFinding

TOLD = 2.0  # s without a frame, or with useless ones only, after which it is told
_USELESS = 10  # frames


@dataclass
class _Use:
    """How far a message's samples got, with how many of its frames, and when that was last new."""

    progress: tuple[int, ...]
    frames: int
    since: int
    is_told: bool = False


class SilenceWatch:
    """Looks at the arrivals now and then."""

    def __init__(self, arrivals: Arrivals) -> None:
        self._arrivals = arrivals
        self._silent: dict[WatchedMessage, int] = {}  # told, and when their last frame came
        self._together: set[WatchedMessage] = set()  # told as all inputs, of these
        self._back_at = 0  # when the first of these came again
        self._uses = {source: _Use((), 0, 0) for source in arrivals.sources if source.streams}

    def look(self, now: int, progress: list[int]) -> list[WatchFinding]:
        """News at a time [ns]; progress: the sample index every stream got to, as `alignment.memory.progress`."""
        return [*self._back(now), *self._silences(now), *self._useless(now, progress)]

    def _silences(self, now: int) -> list[WatchFinding]:
        arrivals = self._arrivals
        new = [
            source
            for source in arrivals.sources
            if source not in self._silent and arrivals.silence(source, now) > max(TOLD, source.patience)
        ]
        if self._back_at and now - self._back_at > TOLD * SECOND:  # what is still away is so by itself
            new += [source for source in arrivals.sources if source in self._together]
            self._together.clear()
            self._back_at = 0
        if not new:
            return []
        for source in new:
            self._silent[source] = arrivals.heard_of(source).last
        sampled = [source for source in arrivals.sources if source.streams]
        if all(source in self._silent for source in sampled):
            self._together = {source for source in sampled if source in new}
            names = ", ".join(source.text for source in new)
            shortest = min(arrivals.silence(source, now) for source in new)
            return [
                WatchFinding(
                    f"no frame of any input for {shortest:.1f} s: {names}\n"
                    "  remedy: check that the measuring devices are on, the cable, and the bit rate"
                )
            ]
        return [
            WatchFinding(
                f"{source.text}: no frame {self._since(source, now)}\n"
                "  remedy: check the device that sends it, its cable and identifier; other inputs come"
            )
            for source in new
        ]

    def _since(self, source: WatchedMessage, now: int) -> str:
        silence = self._arrivals.silence(source, now)
        if self._arrivals.heard_of(source).frames:
            return f"for {silence:.1f} s"
        return f"since the start {silence:.1f} s ago"

    def _back(self, now: int) -> list[WatchFinding]:
        over = []
        for source, last in list(self._silent.items()):
            if self._arrivals.heard_of(source).last > last:
                gone = (self._arrivals.heard_of(source).last - last) / SECOND
                text = f"comes again after {gone:.1f} s" if last else "comes now"
                over.append(WatchFinding(f"{source.text}: {text}", is_over=True))
                del self._silent[source]
                if source in self._together:
                    self._together.discard(source)
                    self._back_at = self._back_at or now
        return over

    def _useless(self, now: int, progress: list[int]) -> list[WatchFinding]:
        told = []
        for source, use in self._uses.items():
            got = tuple(progress[stream] for stream in source.streams)
            frames = self._arrivals.heard_of(source).frames
            if got != use.progress or frames == use.frames:
                if use.is_told and got != use.progress:
                    told.append(WatchFinding(f"{source.text}: its frames can be used again", is_over=True))
                self._uses[source] = _Use(got, frames, now, use.is_told and got == use.progress)
            elif not use.is_told and frames - use.frames > _USELESS and now - use.since > TOLD * SECOND:
                use.is_told = True
                told.append(
                    WatchFinding(
                        f"{source.text}: {frames - use.frames} frames came, and none could be used\n"
                        "  remedy: compare its length, E2EProfile and E2EDataId with the database; is its index or "
                        "counter stuck?"
                    )
                )
        return told
