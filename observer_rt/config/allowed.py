"""What may stand at a place of a user's file, in words, with limits and unit: from its sections' JSON schema."""

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from pydantic import BaseModel

Schema = Mapping[str, Any]
_UNITS = {"_hz": "Hz", "_s": "s", "_ms": "ms", "_us": "us", "_mpa": "MPa", "_um": "um", "bit_rate": "bit/s"}


@dataclass(frozen=True)
class Allowed:
    """What may stand where keys lead to. root, schema: of the whole file, and of this place."""

    root: Schema
    schema: Schema
    keys: tuple[int | str, ...] = ()

    @classmethod
    def at(cls, model: type[BaseModel], location: Iterable[int | str]) -> "Allowed":
        """At the place of one of pydantic's errors, whose own remarks in the location are passed over."""
        root = model.model_json_schema()
        place = cls(root, root)
        for part in location:
            below = next(place._below(part), None)
            if below is not None:
                place = cls(root, below, (*place.keys, part))
        return place

    @property
    def names(self) -> list[str]:
        """Keys of a section."""
        return [name for kind in self._kinds for name in kind.get("properties", ())]

    @property
    def choices(self) -> list[str]:
        """Of a text that must be one of several."""
        return [choice for kind in self._kinds for choice in kind.get("enum", ())]

    def in_words(self) -> str:
        """Such as `a number from 2 to 50 ms`."""
        key = next((part for part in reversed(self.keys) if isinstance(part, str)), "")
        return " or ".join(_in_words(key, kind, self._of(kind.get("items", {}))) for kind in self._kinds)

    def _below(self, part: int | str) -> Iterator[Schema]:
        """What may stand a key or a number of a list further."""
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


def _in_words(key: str, kind: Schema, items: list[Schema]) -> str:
    match kind:
        case {"enum": choices}:
            return f"one of {', '.join(map(json.dumps, choices))}"
        case {"const": value}:
            return json.dumps(value)
        case {"type": "boolean"}:
            return "true or false, without quotes"
        case {"type": "string", "maxLength": 1}:
            return "one character in quotes"
        case {"type": "string"}:
            return f'a text in quotes, such as {key} = "..."'
        case {"type": "integer" | "number" as number}:
            return f"a {'whole ' if number == 'integer' else ''}number{_limits(key, kind)}"
        case {"type": "array", "prefixItems": places}:
            return f"a list of {len(places)} numbers"
        case {"type": "array"}:
            match items[0].get("type"):
                case "object":
                    return f"[[{key}]], with two brackets"
                case "string":
                    return f'a list of texts, such as {key} = ["A", "B"]'
            return f"a list of numbers, such as {key} = [3]"
    return f"a section, [{key}]"


def _limits(key: str, kind: Schema) -> str:
    """Of a number, with its unit as its key says it."""
    unit = next((f" {unit}" for end, unit in _UNITS.items() if key.lower().endswith(end)), "")
    if "minimum" in kind and "maximum" in kind:
        return f" from {kind['minimum']:.10g} to {kind['maximum']:.10g}{unit}"
    limits = [
        f"{word} {kind[name]:.10g}{unit}"
        for name, word in (
            ("minimum", "of at least"),
            ("exclusiveMinimum", "above"),
            ("maximum", "up to"),
            ("exclusiveMaximum", "below"),
        )
        if name in kind
    ]
    return f" {' and '.join(limits)}" if limits else unit and f" of{unit}"
