"""Which channel of a CAN log is which bus of the bench: by name, by number, or as the user says."""

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

from observer_rt.config.links import NamedLink, of_links
from observer_rt.foundation.errors import UserError
from observer_rt.recording.canlog.can_log import ChannelNumbers
from observer_rt.recording.formats import open_log

OPTION = "--from-channel"


def chosen_channels(
    path: Path, links: Sequence[NamedLink], needed: Collection[int], texts: Sequence[str]
) -> dict[int, str | None]:
    """The channel of each bus, None: any of the log, for a bench with one bus. Buses that are not needed may lack.

    texts: `CHANNEL` or `LINK=CHANNEL`, of `--from-channel`. Raises `UserError` where they do not suffice.
    """
    said = of_links(OPTION, texts, links, "can3")
    if len(links) == 1:
        return {0: said.get(0)}
    found = matched_channels(
        path, links, needed, said, lambda bus: f"{OPTION} {links[bus].name}{'=' if bus else ''}CHANNEL"
    )
    return {**found}


def matched_channels(
    path: Path,
    links: Sequence[NamedLink],
    needed: Collection[int],
    said: Mapping[int, str],
    option: Callable[[int], str],
) -> dict[int, str]:
    """The channel of each bus, for several buses; those said are taken, the others found by reading the log.

    A log with names: by the channels of the bench file. One with numbers: by those our own recorder would give these
    channels, else, where there are as many as buses, in order. option: what a user would say for a bus.
    Raises `UserError` for a needed bus that none of this finds.
    """
    open_buses = [bus for bus in range(len(links)) if bus not in said]
    wanted = [bus for bus in open_buses if bus in needed]
    if not wanted:
        return dict(said)
    there = [channel for channel in channels_in(path) if channel not in said.values()]
    numbers = ChannelNumbers()
    by_number = [str(numbers.of(link.config.channel)) for link in links]
    for name_of in ([link.config.channel for link in links], by_number):
        found = {bus: name_of[bus] for bus in open_buses if name_of[bus] in there}
        if found.keys() >= set(wanted):
            return {**said, **found}
    in_order = sorted(filter(str.isdigit, there), key=int)
    for buses in (open_buses, wanted):
        if len(buses) == len(there) == len(in_order):
            return {**said, **dict(zip(buses, in_order, strict=True))}
    names = ", ".join(links[bus].label for bus in wanted)
    raise UserError(
        str(path),
        f"which of its channels is which bus cannot be told: it has {', '.join(there) or 'no other'}, looked for are "
        f"{names}",
        f"say it: {' '.join(option(bus) for bus in wanted)}",
    )


def channels_in(path: Path) -> list[str]:
    """The channels of a log, in order of their first frames. Raises `UserError` for a malformed log."""
    return list(dict.fromkeys(entry.channel for entry in open_log(path)))
