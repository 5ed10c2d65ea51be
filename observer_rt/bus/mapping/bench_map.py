"""Maps of all injectors of a bench: each has its own; a message may be of several."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from observer_rt.bus.can_frame import frame_key
from observer_rt.bus.database.catalogue import BenchDatabases
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.mapping.bus_map import BusMap, map_injector
from observer_rt.config.bench import Bench


class KnownMessage(NamedTuple):
    """A message that some database defines, for a bus; `key` as by `frame_key`."""

    name: str
    key: int
    path: Path
    bus: int


@dataclass(frozen=True)
class BenchMap:
    """Messages and signals of all injectors of a bench file, compiled; `injectors` in its order."""

    injectors: tuple[BusMap, ...]
    database_messages: tuple[KnownMessage, ...]
    """All messages of all databases, used or not."""
    overlooked_faults: tuple[str, ...]
    """Faults of databases that were read leniently."""

    @cached_property
    def received(self) -> tuple[MessageLayout, ...]:
        """Every message that some injector reads something from, once."""
        return _unique(layout for bus in self.injectors for layout in bus.received)

    @cached_property
    def sent(self) -> tuple[MessageLayout, ...]:
        """Every message that some injector's results go out in, once."""
        return _unique(layout for bus in self.injectors for layout in bus.sent)

    @property
    def layouts(self) -> tuple[MessageLayout, ...]:
        """Every message received, then every one sent."""
        return (*self.received, *self.sent)

    def name_of(self, layout: MessageLayout) -> str:
        """Name of a message and, where there are several, of its bus."""
        return self.injectors[0].name_of(layout)


def map_bench(bench: Bench) -> BenchMap:
    """The mapping of all injectors, compiled. Raises `UserError` with file, key and what the database has instead."""
    databases = BenchDatabases(bench)
    return BenchMap(
        tuple(map_injector(injector, databases) for injector in bench.injectors),
        tuple(
            KnownMessage(message.name, frame_key(message.frame_id, message.is_extended_frame, bus), path, bus)
            for path, (message, bus) in databases
        ),
        databases.overlooked_faults(),
    )


def shared_resources(bench: Bench, mapped: BenchMap) -> Iterator[tuple[str, list[str]]]:
    """Messages, numbers and files that several injectors must not share but do, each with the injectors' names."""
    owners: dict[str, list[str]] = {}
    for injector, bus in zip(bench.injectors, mapped.injectors, strict=True):
        for layout in bus.sent:
            message = f"the message {mapped.name_of(layout)} 0x{layout.frame_id:X}"
            owners.setdefault(message, []).append(injector.name)
        owners.setdefault(f"outputs.injector_id = {injector.config.outputs.injector_id}", []).append(injector.name)
        for key, file in (("file", injector.state), ("journal", injector.journal)):
            if file is not None:
                owners.setdefault(f"state.{key} = {file}", []).append(injector.name)
    return ((resource, names) for resource, names in owners.items() if len(names) > 1)


def _unique(layouts: Iterable[MessageLayout]) -> tuple[MessageLayout, ...]:
    return tuple({(layout.name, layout.bus, layout.frame_id): layout for layout in layouts}.values())
