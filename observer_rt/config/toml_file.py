"""TOML files of the user: read, validated, refused with file, key, remedy and what may stand there instead."""

import json
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from observer_rt.foundation.errors import UserError, did_you_mean

Schema = Mapping[str, Any]
_TYPES = {
    "boolean": "true or false, without quotes",
    "string": "a text in quotes",
    "integer": "a whole number",
    "number": "a number",
    "array": "a list in brackets",
    "object": "a section",
}
_LIMITS = {
    "minimum": "of at least",
    "exclusiveMinimum": "above",
    "maximum": "up to",
    "exclusiveMaximum": "below",
}

_Model = TypeVar("_Model", bound=BaseModel)
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


@dataclass(frozen=True)
class EntrySchema:
    """Schema of an entry of a file. root, schema: of the whole file, and of this entry."""

    root: Schema
    schema: Schema
    keys: tuple[int | str, ...] = ()

    @classmethod
    def at(cls, model: type[BaseModel], location: Iterable[int | str]) -> "EntrySchema":
        """Schema at the location of a pydantic error; parts of the location that are no keys are skipped."""
        root = model.model_json_schema()
        entry = cls(root, root)
        for part in location:
            below = next(entry._below(part), None)
            if below is not None:
                entry = cls(root, below, (*entry.keys, part))
        return entry

    @property
    def names(self) -> list[str]:
        """Keys of a section."""
        return [name for kind in self._kinds for name in kind.get("properties", ())]

    @property
    def choices(self) -> list[str]:
        """Choices for a text that must be one of several."""
        return [choice for kind in self._kinds for choice in kind.get("enum", ())]

    def in_words(self) -> str:
        """The allowed values as text, such as `a number from 2 to 50`."""
        return " or ".join(map(self._of_kind, self._kinds))

    def _of_kind(self, kind: Schema) -> str:
        if "enum" in kind or "const" in kind:
            return f"one of {', '.join(map(json.dumps, kind.get('enum', [kind.get('const')])))}"
        if kind.get("maxLength") == 1:
            return "one character in quotes"
        if self._of(kind.get("items", {}))[0].get("type") == "object":
            return f"[[{self.keys[-1]}]], with two brackets"
        if "minimum" in kind and "maximum" in kind:
            return f"{_TYPES[kind['type']]} from {kind['minimum']:.10g} to {kind['maximum']:.10g}"
        limits = [f"{word} {kind[name]:.10g}" for name, word in _LIMITS.items() if name in kind]
        return " ".join([_TYPES[kind.get("type", "object")], " and ".join(limits)]).strip()

    def _below(self, part: int | str) -> Iterator[Schema]:
        """Schemas of the entries one key, or one list index, further down."""
        for kind in self._kinds:
            if isinstance(part, int):
                yield from [*kind.get("prefixItems", ())[part:], *filter(None, [kind.get("items")])]
            elif part in kind.get("properties", ()):
                yield kind["properties"][part]
            elif part != "[key]":  # pydantic's mark of a bad name
                yield from filter(None, [kind.get("additionalProperties")])
                yield from kind.get("patternProperties", {}).values()

    @cached_property
    def _kinds(self) -> list[Schema]:
        """The kinds of value there may be, but for nothing at all."""
        return [kind for kind in self._of(self.schema) if kind.get("type") != "null"]

    def _of(self, schema: Schema) -> list[Schema]:
        if "$ref" in schema:
            return self._of(self.root["$defs"][schema["$ref"].rpartition("/")[2]])
        return [kind for choice in schema.get("anyOf", ()) for kind in self._of(choice)] or [schema]


class Section(BaseModel):
    """A section of a file; unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def validated(
    model: type[_Model], document: Mapping[str, Any], location_of: Callable[..., str], kind: str
) -> _Model:
    """A document as a model. kind: of the complete example that `run --print-example-<kind>` prints.

    Types are strict: no text for a number, no number for a switch. location_of: gives the location of an entry by the
    keys that lead to it. Raises `UserError` naming location, problem and remedy.
    """
    try:
        # as JSON, where a list is a tuple and a text a choice, however strict
        return model.model_validate_json(json.dumps(document, default=str), strict=True)
    except ValidationError as error:
        errors = error.errors()
        # a misspelt key also shows as a missing one: name the cause
        first: Any = next((e for e in errors if e["type"] == "extra_forbidden"), errors[0])
        if first["type"] == "extra_forbidden":
            *section, key = first["loc"]
            allowed = EntrySchema.at(model, section)
            raise unknown_key(location_of(*allowed.keys, key), key, allowed.names) from None
        allowed = EntrySchema.at(model, first["loc"])
        raise UserError(location_of(*allowed.keys), *_explanation(first, allowed, kind)) from None


def place_in(path: Path) -> Callable[..., str]:
    """Function by which `validated` names the places of a file."""
    return lambda *location: f"{path}: {'.'.join(map(str, location)) or 'file'}"


def unknown_key(location: str, key: str, keys: Iterable[str]) -> UserError:
    """The error for a key that is not among the known ones."""
    names = list(keys)
    return UserError(location, "unknown key", f"{did_you_mean(key, names)}known keys: {', '.join(names)}")


def read_toml(path: Path) -> dict[str, Any]:
    """The content of a file. Raises `UserError`."""
    try:
        content = path.read_bytes()
        return tomllib.loads(content.decode("utf-8-sig").replace("\r\n", "\n"))
    except FileNotFoundError:
        raise UserError(str(path), "no such file", "correct the path") from None
    except OSError as error:
        raise UserError(str(path), f"cannot be read: {error.strerror}", "name a file") from None
    except UnicodeDecodeError as error:
        line = 1 + content[: error.start].count(b"\n")
        raise UserError(f"{path}:{line}", "is not UTF-8 text", "save it as UTF-8 in your editor") from None
    except RecursionError:
        raise UserError(str(path), "is not valid TOML: nested too deeply", "mend it") from None
    except ValueError as error:  # TOMLDecodeError, or a number of more digits than Python reads
        raise UserError(str(path), f"is not valid TOML: {error}", "mend the line named") from None


def _explanation(error: Any, allowed: EntrySchema, kind: str) -> tuple[str, str]:
    """Problem and remedy for one pydantic error."""
    if error["type"] == "missing":
        example = f"`observer-rt run --print-example-{kind}` shows a complete file"
        return "is missing", f"add it, {allowed.in_words()}; {example}"
    value = error.get("input")
    shown = f"{value!r} " if isinstance(value, str | int | float | bool) else ""
    if "[key]" in error["loc"]:  # pydantic's mark of a bad name
        return f"{shown}is not allowed as a name", "use letters, digits, '_', '-' and '.'"
    if error["type"] == "value_error":  # of ours, with a remedy
        problem, _, remedy = str(error["ctx"]["error"]).partition("; ")
        return f"{shown}is not allowed: {problem}", remedy or "correct it"
    meant = did_you_mean(str(value), allowed.choices)
    return f"{shown}is not allowed", f"{meant}write {allowed.in_words()}"
