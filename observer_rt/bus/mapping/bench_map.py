"""All injectors of a bench on its buses: each has its own map, a message may be of several."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from observer_rt.bus.database.catalogue import BenchDatabases
from observer_rt.bus.database.frame_key import frame_key
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.mapping.bus_map import BusMap, map_injector
from observer_rt.config.bench import Bench


class Destination(NamedTuple):
    """What a received frame carries: an input message of an injector, both by number."""

    injector: int
    message: int


class KnownMessage(NamedTuple):
    """A message that some database defines, for a bus; `key` as by `frame_key`."""

    name: str
    key: int
    path: Path
    bus: int


@dataclass(frozen=True)
class BenchMap:
    """Everything a bench file says of its buses, compiled; `injectors` in its order."""

    injectors: tuple[BusMap, ...]
    known: tuple[KnownMessage, ...]
    """All messages of all databases, used or not."""
    overlooked: tuple[str, ...]
    """What is wrong with databases that were read leniently."""

    @cached_property
    def destinations(self) -> Mapping[int, tuple[Destination, ...]]:
        """Where the samples of a frame go, by its `frame_key`."""
        found: dict[int, tuple[Destination, ...]] = {}
        for injector, bus in enumerate(self.injectors):
            for message in range(len(bus.input_layouts)):
                key = int(bus.inputs.messages[message]["key"])
                found[key] = (*found.get(key, ()), Destination(injector, message))
        return found

    @cached_property
    def received(self) -> tuple[MessageLayout, ...]:
        """Every message that some injector reads something from, once."""
        return _once(layout for bus in self.injectors for layout in bus.received)

    @cached_property
    def sent(self) -> tuple[MessageLayout, ...]:
        """Every message that some injector's results go out in, once."""
        return _once(layout for bus in self.injectors for layout in bus.sent)

    @property
    def layouts(self) -> tuple[MessageLayout, ...]:
        """Every message received, then every one sent."""
        return (*self.received, *self.sent)

    def name_of(self, layout: MessageLayout) -> str:
        """Its name and, where there are several, its bus."""
        return self.injectors[0].name_of(layout)


def map_bench(bench: Bench) -> BenchMap:
    """Compile the mapping of all injectors.

    Raises `UserError` naming bench file, key and what the database has instead.
    """
    databases = BenchDatabases(bench)
    return BenchMap(
        tuple(map_injector(injector, databases) for injector in bench.injectors),
        tuple(
            KnownMessage(message.name, frame_key(message.frame_id, message.is_extended_frame, bus), path, bus)
            for path, (message, bus) in databases
        ),
        databases.overlooked(),
    )


def in_common(bench: Bench, mapped: BenchMap) -> Iterator[tuple[str, list[str]]]:
    """What several injectors cannot share, and yet do, with their names: results, and what tells these apart."""
    owners: dict[str, list[str]] = {}
    for injector, bus in zip(bench.injectors, mapped.injectors, strict=True):
        for layout in bus.sent:
            message = f"the message {mapped.name_of(layout)} 0x{layout.frame_id:X}"
            owners.setdefault(message, []).append(injector.name)
        number = injector.config.outputs.injector_id
        owners.setdefault(f"outputs.injector_id = {number}", []).append(injector.name)
        for key, file in (("file", injector.state), ("journal", injector.journal)):
            if file is not None:
                owners.setdefault(f"state.{key} = {file}", []).append(injector.name)
    return ((what, names) for what, names in owners.items() if len(names) > 1)


def _once(layouts: Iterable[MessageLayout]) -> tuple[MessageLayout, ...]:
    return tuple({(layout.name, layout.bus, layout.frame_id): layout for layout in layouts}.values())
