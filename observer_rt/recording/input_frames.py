"""The input frames of a bench in a CAN log: what the observer would have received."""

from collections.abc import Iterator
from pathlib import Path

from observer_rt.bus.link import Frame
from observer_rt.bus.mapping import BusMap
from observer_rt.errors import UserError
from observer_rt.recording.log import LogReader
from observer_rt.recording.logs import open_log


class InputFrames:
    """Frames of the bench's input messages in a log, on one of its channels; may be iterated again and again.

    Iterating raises `UserError` for a malformed log, for one without such frames, and where the frames of one
    message come from several channels and none was chosen.
    """

    def __init__(self, path: Path, bus: BusMap, channel: str | None) -> None:
        self.path = path
        self._wanted = {(layout.frame_id, layout.is_extended): layout.name for layout in bus.received}
        self._channel = channel
        self._log: LogReader = open_log(path)

    def __iter__(self) -> Iterator[Frame]:
        channel_of: dict[str, str] = {}
        others: dict[tuple[int, bool], None] = {}
        channels: dict[str, None] = {}
        for entry in self._log:
            frame = entry.frame
            channels[entry.channel] = None
            name = self._wanted.get((frame.frame_id, frame.is_extended))
            if name is None:
                others[frame.frame_id, frame.is_extended] = None
            elif self._channel is None or entry.channel == self._channel:
                if channel_of.setdefault(name, entry.channel) != entry.channel:
                    raise UserError(
                        str(self.path),
                        f"{name} is on several channels: {channel_of[name]}, {entry.channel}",
                        "choose one by --from-channel",
                    )
                yield frame
        if not channel_of:
            self._refuse_empty(list(channels), [identifier for identifier, _ in others])

    def notes(self) -> list[str]:
        """What the reader of the log has to say after the last reading."""
        return self._log.notes()

    @property
    def share_read(self) -> float:
        """How much of the log was read, 0 to 1."""
        return self._log.share_read

    def _refuse_empty(self, channels: list[str], others: list[int]) -> None:
        if not channels:
            notes = "; ".join(["holds no data frame", *self.notes()])
            raise UserError(str(self.path), notes, "record it while frames are on the bus")
        if self._channel is not None and self._channel not in channels:
            raise UserError(
                "--from-channel",
                f"{self.path} has no channel {self._channel}",
                f"it has {', '.join(channels)}",
            )
        wanted = ", ".join(f"{name} (0x{identifier:X})" for (identifier, _), name in self._wanted.items())
        there = ", ".join(f"0x{identifier:X}" for identifier in sorted(set(others))[:8])
        raise UserError(
            str(self.path),
            f"holds no frame of {wanted}; it has {there}",
            "give --bench with the file the log was recorded by",
        )
