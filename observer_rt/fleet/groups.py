"""Recordings of one injector together, as discovery takes them."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import pyarrow as pa

from observer_rt.config.bench import Bench
from observer_rt.config.channels import effects_on_one_raster
from observer_rt.config.injector_file import InjectorFile
from observer_rt.discovery.search.fit_store import problem_key
from observer_rt.fleet.names import InjectorNames
from observer_rt.foundation.errors import UserError

MOST_RECORDINGS = 16
"""The latest ones of an injector: wear of months is no single size, and a search takes time and memory by samples."""
NEEDED = ("injector", "sha256", "time")
"""Columns of a batch's rows that groups are made of."""


@dataclass(frozen=True)
class ModelGroup:
    """Injectors of one model. alone: the bench with this injector only; file: its model, which is to be amended."""

    alone: Bench
    file: InjectorFile


@dataclass(frozen=True)
class Group:
    """Recordings of an injector, by path and SHA-256, the latest first; recordings: how many there are in all."""

    injector: str
    kind: ModelGroup
    files: tuple[tuple[Path, str], ...]
    recordings: int

    @property
    def folder(self) -> str:
        """Name of its folder: any name of an injector can be one."""
        name = quote(self.injector, safe="")
        return name.replace(".", "%2E") if set(name) == {"."} else name

    def key(self, healthy: Sequence[str]) -> str:
        """SHA-256 of all its answer depends on: recordings, model, vocabulary, program. healthy: hashes of those."""
        injector = self.kind.alone.injector
        own = problem_key(
            injector.parameters,
            sorted(sha256 for _, sha256 in self.files),
            effects_on_one_raster(injector),
        )
        content = [own, self.kind.file.sha256, sorted(healthy)]
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def kinds_of(bench: Bench, pattern: str | None) -> tuple[ModelGroup, ...]:
    """The injectors of a bench, as discovery needs them.

    Raises `UserError` for a bench file or an injector file discovery cannot use, and for names by a pattern where
    every recording is of several injectors.
    """
    if pattern is not None and len(bench.injectors) > 1:
        names = ", ".join(each.name for each in bench.injectors)
        raise UserError(
            f"{InjectorNames.OPTION} {pattern}",
            f"gives one name to {len(bench.injectors)} injectors of {bench.path}: {names}",
            f"choose one of them, such as --injector {bench.injectors[0].name}, or leave the pattern out",
        )
    for injector in bench.injectors:
        effects_on_one_raster(injector)
    return tuple(
        ModelGroup(alone, InjectorFile.read(alone.injector.parameters_path.absolute()))
        for alone in bench.each
    )


def groups_of(rows: pa.Table, files: Mapping[str, Path], kinds: Sequence[ModelGroup]) -> list[Group]:
    """A group for every injector that has injections in the rows of a batch (columns `NEEDED`), by name.

    files: paths by SHA-256; rows of other files are left out. kinds: one, or those of a bench by their own names.
    """
    own_names = {InjectorNames(None).of(Path(), kind.alone): kind for kind in kinds}
    of_injector: dict[str, list[tuple[Path, str]]] = {}
    first = rows.group_by(["injector", "sha256"]).aggregate([("time", "min")])
    for row in sorted(first.to_pylist(), key=lambda row: (row["time_min"], row["sha256"]), reverse=True):
        if (path := files.get(row["sha256"])) is not None:
            of_injector.setdefault(row["injector"], []).append((path, row["sha256"]))
    return [
        Group(
            name,
            kinds[0] if len(kinds) == 1 else own_names[name],
            tuple(found[:MOST_RECORDINGS]),
            len(found),
        )
        for name, found in sorted(of_injector.items())
    ]
