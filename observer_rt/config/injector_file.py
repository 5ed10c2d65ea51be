"""Injector files that are changed and written again, with their comments and layout."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, Self

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, InlineTable

from observer_rt.config.bench import load_injector
from observer_rt.foundation.errors import RunError, UserError, file_errors
from observer_rt.foundation.files import file_hash, replacing
from observer_rt.model.parameters import EffectInForce
from observer_rt.model.terms.in_force import TermInForce

_PAIR = 2  # numbers of a list that still counts as short


class InjectorFile(NamedTuple):
    """An injector file from which another is made: its name, SHA-256 and text."""

    name: str
    sha256: str
    text: str

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a file. Raises `UserError` for one that cannot be changed as text."""
        text = path.read_text(encoding="utf-8")
        try:
            tomlkit.parse(text)
        except TOMLKitError as error:
            raise UserError(str(path), f"is not valid TOML: {error}", "mend the line named") from None
        return cls(path.name, file_hash(path), text)

    @contextmanager
    def changed(self, path: Path) -> Iterator[tomlkit.TOMLDocument]:
        """Yield the content to change, then written to a path; `RunError`, and no change, if it would not load."""
        document = tomlkit.parse(self.text)
        yield document
        with file_errors(path), replacing(path) as part:
            part.write_text(tomlkit.dumps(document), encoding="utf-8")
            try:
                load_injector(part)
            except UserError as error:
                raise RunError(f"{path}: what was written would not load: {error.problem}") from None


def inline(entry: Mapping[str, Any]) -> InlineTable:
    """A mapping as a table in one line."""
    table = tomlkit.inline_table()
    for key, value in entry.items():
        table.append(key, inline(value) if isinstance(value, Mapping) else value)
    return table


def section_of(entry: Mapping[str, Any]) -> Any:
    """A section: a mapping in it is a section below, or one line if it holds numbers and pairs only."""
    table = tomlkit.table()
    for key, value in entry.items():
        if isinstance(value, dict):
            value = inline(value) if all(map(_is_short, value.values())) else section_of(value)
        table[key] = value
    return table


def _is_short(value: Any) -> bool:
    return len(value) <= _PAIR if isinstance(value, list) else not isinstance(value, dict)


def tables_in_force(entries: Sequence[EffectInForce] | Sequence[TermInForce]) -> AoT:
    """Effects or terms in force as [[effects]] or [[terms]] tables."""
    tables = tomlkit.aot()
    for entry in entries:
        table = tomlkit.table()
        for key, value in entry.model_dump(mode="json", exclude_none=True, exclude_defaults=True).items():
            table[key] = inline(value) if isinstance(value, Mapping) else value
        tables.append(table)
    return tables
