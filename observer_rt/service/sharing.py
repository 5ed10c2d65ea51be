"""What several injectors of one process share, and what they cannot."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from observer_rt.bus.links.shared import SharedBus
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import Bench
from observer_rt.config.bench_file import NAME_PLACE
from observer_rt.foundation.errors import UserError
from observer_rt.service.notify import Notifier
from observer_rt.service.opening import buses_of, connected, wanted_on
from observer_rt.service.reports.deduplication import Once

OPENED_OFTEN = ("socketcan", "virtual")  # interfaces whose channels can be opened several times


@dataclass(frozen=True)
class Shared:
    """What all injectors use. buses: by their number, those that can be opened once only; once: what was said."""

    notifier: Notifier
    buses: Mapping[int, SharedBus]
    once: Once = field(default_factory=Once)


def shared_buses(bench: Bench, maps: Iterable[BusMap]) -> dict[int, SharedBus]:
    """The buses, by their numbers, that several injectors use and that can be opened once only."""
    shared = {}
    for number, named in enumerate(bench.config.buses):
        users = [bus for bus in maps if number in buses_of(bus)]
        if len(users) > 1 and named.config.interface not in OPENED_OFTEN:
            wanted = list(dict.fromkeys(each for bus in users for each in wanted_on(bus, number)))
            computer_time = any(len(buses_of(bus)) > 1 for bus in users)
            shared[number] = SharedBus(partial(connected, named, wanted, computer_time))
    return shared


def refuse_shared(bench: Bench, state: Path | None, journal: Path | None) -> None:
    """Raise `UserError` where several injectors would have one file of the command line."""
    names = [injector.name for injector in bench.injectors]
    for option, key, path in (("--state", "file", state), ("--journal", "journal", journal)):
        if path is not None and len(names) > 1:
            raise UserError(
                f"{option} {path}",
                f"is one file for {len(names)} injectors: {', '.join(names)}",
                f'leave it out, and state [state] {key} = "{path.stem}_{NAME_PLACE}{path.suffix}" in the bench file',
            )
