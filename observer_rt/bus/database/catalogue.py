"""The bus databases of a bench: which file and which bus a message belongs to."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from cantools.database.can import Database, Message

from observer_rt.bus.database.dbc_file import load_database, overlooked_faults
from observer_rt.bus.database.lookup import find_message
from observer_rt.config.bench import Bench
from observer_rt.foundation.errors import UserError


class BusMessage(NamedTuple):
    """A message, and the number of the bus it is on."""

    message: Message
    bus: int


class _BusDatabase(NamedTuple):
    """A database of the bench, and the number of the bus its messages are on."""

    path: Path
    lenient: bool
    content: Database
    bus: int


class BenchDatabases:
    """The databases a bench file names, read. Raises `UserError` for one that cannot be."""

    def __init__(self, bench: Bench) -> None:
        self._config = bench.config
        self.links = tuple(link.config for link in bench.config.buses)
        self.labels = tuple(link.label for link in bench.config.buses)
        self._databases = [
            _BusDatabase(path, entry.lenient, load_database(path, entry.lenient), bench.config.bus_number(entry.link))
            for path, entry in zip(bench.databases, bench.config.dbc, strict=True)
        ]

    def find(self, location: str, name: str, link: str | None) -> BusMessage:
        """The first message of this name; link: its bus, whose databases are looked through before the others.

        Raises `UserError` at `location`, a key of the bench file, with what the database has instead.
        """
        bus, candidates = None, self._databases
        if link is not None:
            bus = self._config.bus_number(link)
            candidates = sorted(self._databases, key=lambda database: database.bus != bus)
        with_name = (database for database in candidates if any(m.name == name for m in database.content.messages))
        database = next(with_name, candidates[0])
        with locating(location):
            return BusMessage(find_message(database.content, name), database.bus if bus is None else bus)

    def __iter__(self) -> Iterator[tuple[Path, BusMessage]]:
        """Iterate over all messages, used or not, on the buses of their databases."""
        for database in self._databases:
            yield from ((database.path, BusMessage(message, database.bus)) for message in database.content.messages)

    def overlooked_faults(self) -> tuple[str, ...]:
        """Faults of databases that were read leniently."""
        paths = (database.path for database in self._databases if database.lenient)
        return tuple(f"{path}: {complaint}" for path in paths for complaint in overlooked_faults(path))


@contextmanager
def locating(location: str) -> Iterator[None]:
    """Let errors that name message and signal also name the location in the bench file."""
    try:
        yield
    except UserError as error:
        raise UserError(location, f"{error.location} {error.problem}", error.remedy) from None
