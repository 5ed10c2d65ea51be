"""Documents for programs: frozen pydantic models, dumped as JSON, read back, published as JSON Schema."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

import pydantic
from pydantic_core import CoreSchema, core_schema

from observer_rt.foundation.errors import UserError, file_errors

Number = Annotated[
    float | None,
    pydantic.BeforeValidator(lambda value: None if isinstance(value, float) and not math.isfinite(value) else value),
]
"""A figure; null where it is not finite."""
Figures = Annotated[dict[str, Number], pydantic.Field(description="by name, which ends with the unit")]


class _AnyValue:
    """A field whose type is of no concern to a document."""

    def __get_pydantic_core_schema__(self, *_: object) -> CoreSchema:
        return core_schema.any_schema()


T = TypeVar("T")
Inside = Annotated[T, _AnyValue(), pydantic.Field(exclude=True)]
"""A field of a data class that its document leaves out."""


def key(name: str) -> Any:
    """Metadata of a field of a data class: its key in a document."""
    return pydantic.Field(serialization_alias=name)


def unit(si: float) -> pydantic.PlainSerializer:
    """Metadata of a figure [SI] of a data class: its unit in a document; null where it is not finite."""
    return pydantic.PlainSerializer(
        lambda value: value / si if math.isfinite(value) else None, return_type=float | None, when_used="json"
    )


Figure = Annotated[float, unit(1.0)]
"""A figure of a data class in the unit of its document."""


@dataclass(frozen=True)
class Entry:
    """Metadata of a field of a data class whose entry in a document is of another type.

    made: the entry, of the field's value and the object that the document is dumped with as context; kind: its type.
    """

    made: Callable[[Any, Any], Any]
    kind: Any

    def __get_pydantic_core_schema__(self, _: object, handler: pydantic.GetCoreSchemaHandler) -> CoreSchema:
        entry = core_schema.plain_serializer_function_ser_schema(
            lambda value, info: self.made(value, info.context),
            info_arg=True,
            return_schema=handler.generate_schema(self.kind),
        )
        return core_schema.any_schema(serialization=entry)


class Section(pydantic.BaseModel):
    """A section of a file of the user; unknown keys are refused."""

    model_config = pydantic.ConfigDict(frozen=True, extra="forbid")


class DocumentPart(pydantic.BaseModel):
    """A part of a document: figures in the units of their names."""

    model_config = pydantic.ConfigDict(frozen=True, allow_inf_nan=False)


class Document(DocumentPart):
    """A document with the version of its schema."""

    schema_: Literal[1] = pydantic.Field(alias="schema")

    def as_json(self) -> dict[str, Any]:
        """The document as JSON has it: what was stated, null included."""
        return self.model_dump(mode="json", by_alias=True, exclude_unset=True)

    @classmethod
    def read(cls, path: Path, what: str, remedy: str) -> Self:
        """Reads a file. Raises `UserError` naming file and key for one that is not `what`."""
        with file_errors(path):
            text = path.read_bytes()
        try:
            return cls.model_validate_json(text)
        except pydantic.ValidationError as error:
            first = error.errors()[0]
            key = ".".join(map(str, first["loc"])) or "file"
            raise UserError(str(path), f"is no {what}: {key}: {first['msg'].lower()}", remedy) from None
