"""Channels of a CAN log as buses of the bench, and the input frames that the observer would have received."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

from observer_rt.bus.can_frame import EXTENDED_FLAG, STANDARD_MASK
from observer_rt.bus.links.link import BusFrame
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench_file import NamedLink, values_by_bus
from observer_rt.files.canlog.can_log import ChannelNumbers, LogReader
from observer_rt.files.formats import open_log
from observer_rt.foundation.errors import UserError

OPTION = "--from-channel"


def chosen_channels(
    path: Path, links: Sequence[NamedLink], needed: Collection[int], texts: Sequence[str]
) -> Mapping[int, str | None]:
    """The channel of each bus; None: any of the log, on a bench with one bus. Buses not needed may be left out.

    texts: `CHANNEL` or `LINK=CHANNEL`; several buses are else matched by channel names, or by our recorder's numbers.
    Raises `UserError` for a needed bus that is not found.
    """
    stated = values_by_bus(OPTION, texts, links, "can3")
    if len(links) == 1:
        return {0: stated.get(0)}
    open_buses = [bus for bus in range(len(links)) if bus not in stated]
    wanted = [bus for bus in open_buses if bus in needed]
    if not wanted:
        return dict(stated)
    channels = dict.fromkeys(entry.channel for entry in open_log(path))
    present = [name for name in channels if name not in stated.values()]
    numbers = ChannelNumbers()
    by_number = [str(numbers.of(link.config.channel)) for link in links]
    for name_of in ([link.config.channel for link in links], by_number):
        matches = {bus: name_of[bus] for bus in open_buses if name_of[bus] in present}
        if matches.keys() >= set(wanted):
            return {**stated, **matches}
    names = ", ".join(links[bus].label for bus in wanted)
    raise UserError(
        str(path),
        f"which of its channels is which bus is not clear: it has {', '.join(present) or 'no other'}, wanted are "
        f"{names}",
        "say it: " + " ".join(f"{OPTION} {links[bus].name}{'=' if bus else ''}CHANNEL" for bus in wanted),
    )


class InputFrames:
    """Frames of the bench's inputs in a log, with their buses, any number of times. Iterating raises `UserError`."""

    def __init__(self, path: Path, bus_map: BusMap, channels: Mapping[int, str | None]) -> None:
        """channels: of the log, by bus, as by `chosen_channels`."""
        self.path = path
        self._bus_map = bus_map
        self._channels = channels
        self._wanted: dict[tuple[int, bool], list[tuple[int, str]]] = {}
        for layout in bus_map.received:
            if layout.bus in channels:
                self._wanted.setdefault((layout.frame_id, layout.is_extended), []).append((layout.bus, layout.name))
        self.log: LogReader = open_log(path)

    def __iter__(self) -> Iterator[BusFrame]:
        channel_of: dict[tuple[int, str], str] = {}
        others: dict[tuple[int, bool], None] = {}
        channels: dict[str, None] = {}
        for entry in self.log:
            frame = entry.frame
            channels[entry.channel] = None
            messages = self._wanted.get((frame.frame_id, frame.is_extended))
            if messages is None:
                others[frame.frame_id, frame.is_extended] = None
                continue
            for message in messages:
                bus, name = message
                if self._channels[bus] not in (None, entry.channel):
                    continue
                if channel_of.setdefault(message, entry.channel) != entry.channel:
                    problem = f"{name} is on several channels: {channel_of[message]}, {entry.channel}"
                    raise UserError(str(self.path), problem, f"choose one by {OPTION}")
                yield BusFrame(bus, frame)
                break
        received = {bus for bus, _ in channel_of}
        for bus in sorted({layout.bus for layout in self._bus_map.input_layouts} - received):
            self._refuse_empty(bus, list(channels), sorted(others))

    def notes(self) -> list[str]:
        """Notes of the reader of the log after the last reading."""
        notes = self.log.notes()
        if len(self._channels) > 1:
            pairs = (f"{channel} is {self._bus_map.labels[bus]}" for bus, channel in sorted(self._channels.items()))
            notes.append(f"{self.path}: channel {', '.join(pairs)}")
        return notes

    def _refuse_empty(self, bus: int, channels: list[str], others: list[tuple[int, bool]]) -> None:
        if not channels:
            notes = "; ".join(["holds no data frame", *self.notes()])
            raise UserError(str(self.path), notes, "record it while frames are on the bus")
        channel = self._channels[bus]
        if channel is not None and channel not in channels:
            raise UserError(OPTION, f"{self.path} has no channel {channel}", f"it has {', '.join(channels)}")
        layouts = [layout for layout in self._bus_map.received if layout.bus == bus]
        wanted = ", ".join(f"{one.name} ({_identifier_text(one.frame_id, one.is_extended)})" for one in layouts)
        present = ", ".join(_identifier_text(*identifier) for identifier in others[:8])
        where, remedy = "", "give --bench with the file the log was recorded by"
        groups = {_parameter_group(identifier): identifier for identifier, is_extended in others if is_extended}
        for layout in layouts:
            if layout.is_extended and (same := groups.get(_parameter_group(layout.frame_id))):
                remedy += (
                    f"; or, if this is J1939, 0x{same:X} is its parameter group of another source address or "
                    f"priority: set the identifier of {layout.name} in the database to {same | EXTENDED_FLAG}"
                )
            elif (layout.frame_id, not layout.is_extended) in others:
                remedy += f"; or correct the size of the identifier of {layout.name}, 11 or 29 bits, in the database"
        if len(self._channels) > 1:
            where = f" on channel {channel}, which is taken for {self._bus_map.labels[bus]}"
            remedy += f", or say which channel is which bus by {OPTION}"
        raise UserError(str(self.path), f"holds no frame of {wanted}{where}; it has {present}", remedy)


def _identifier_text(identifier: int, is_extended: bool) -> str:
    """An identifier, with its size where its number does not tell."""
    return f"0x{identifier:X}" + (" of 29 bits" if is_extended and identifier <= STANDARD_MASK else "")


def _parameter_group(identifier: int) -> int:
    """Number of the parameter group by J1939-21, whose low byte is an address below 0xF000."""
    group = identifier >> 8 & 0x3FFFF
    return group if group & 0xFF00 >= 0xF000 else group & ~0xFF
