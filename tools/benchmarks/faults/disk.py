"""A simulated disk: after a loss of power it holds the synced writes, and any others, each torn at any byte."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from numpy.random import Generator


@dataclass(frozen=True)
class Operation:
    """As `native/disk_log.c` notes it."""

    kind: str
    descriptor: int
    offset: int
    data: bytes
    path: str
    target: str


@dataclass
class _File:
    """Content on disk, and what waits to get there: (offset, data), data None: a new length."""

    content: bytearray = field(default_factory=bytearray)
    waiting: list[tuple[int, bytes | None]] = field(default_factory=list)

    def sync(self) -> None:
        for change in self.waiting:
            _apply(self.content, *change)
        self.waiting.clear()

    def after_cut(self, chance: Generator) -> bytes:
        content = bytearray(self.content)
        for offset, data in self.waiting:
            fate = chance.random()
            if fate < 1 / 3:
                continue
            if data is not None and fate < 2 / 3:
                data = data[: int(chance.integers(len(data) + 1))]
            _apply(content, offset, data)
        return bytes(content)


class Disk:
    """Follows operations; `cut` writes what may be left of them."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._names: dict[str, _File] = {}
        self._durable: dict[str, _File] = {}
        self._moves: list[tuple[str, str, _File | None]] = []  # names to be set or taken away, in order
        self._open: dict[int, _File | None] = {}  # None: the folder

    def do(self, operation: Operation) -> None:
        kind, fd = operation.kind, operation.descriptor
        if kind in ("open", "create", "trunc"):
            self._begin(operation)
        elif kind == "close":
            self._open.pop(fd, None)
        elif kind == "rename":
            moved = self._names[operation.target] = self._names.pop(operation.path)
            self._moves.append(("rename", f"{operation.path}\n{operation.target}", moved))
        elif kind == "unlink":
            self._names.pop(operation.path, None)
            self._moves.append(("unlink", operation.path, None))
        elif fd in self._open:
            file = self._open[fd]
            if file is None and kind == "sync":
                for move in self._moves:
                    _move(self._durable, move)
                self._moves.clear()
            elif file is not None and kind == "sync":
                file.sync()
            elif file is not None:
                file.waiting.append((operation.offset, operation.data if kind == "write" else None))

    def cut(self, target: Path, chance: Generator) -> None:
        """Write into a folder what a loss of power now may leave."""
        names = dict(self._durable)
        for move in self._moves[: int(chance.integers(len(self._moves) + 1))]:
            _move(names, move)
        for path, file in names.items():
            (target / Path(path).name).write_bytes(file.after_cut(chance))

    def _begin(self, operation: Operation) -> None:
        path = operation.path
        if Path(path) == self._folder:
            self._open[operation.descriptor] = None
            return
        if path not in self._names:
            self._names[path] = _File()
            self._moves.append(("set", path, self._names[path]))
        elif operation.kind == "trunc":
            self._names[path].waiting.append((0, None))
        self._open[operation.descriptor] = self._names[path]


def operations(log: Path) -> Sequence[Operation]:
    done, data, at = [], log.read_bytes(), 0
    while at < len(data):
        end = data.index(b"\n", at)
        kind, descriptor, offset, length, path, target = data[at:end].decode().split("\t")
        at = end + 1 + int(length)
        done.append(Operation(kind, int(descriptor), int(offset), data[end + 1 : at], path, target))
    return done


def _apply(content: bytearray, offset: int, data: bytes | None) -> None:
    end = offset if data is None else offset + len(data)
    content.extend(bytes(max(end - len(content), 0)))
    if data is None:
        del content[offset:]
    else:
        content[offset:end] = data


def _move(names: dict[str, _File], move: tuple[str, str, _File | None]) -> None:
    kind, path, file = move
    if kind == "rename":
        source, path = path.split("\n")
        names.pop(source, None)
    if file is None:
        names.pop(path, None)
    else:
        names[path] = file
