"""Documents for programs: frozen pydantic models, dumped as JSON, read back, published as JSON Schema."""

import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors

Number = Annotated[
    float | None,
    BeforeValidator(lambda value: None if isinstance(value, float) and not math.isfinite(value) else value),
]
"""A figure; null where it is not finite."""
Figures = Annotated[dict[str, Number], Field(description="by name, which ends with the unit")]


class DocumentPart(BaseModel):
    """A part of a document: figures in the units of their names."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)


class Document(DocumentPart):
    """A document with the version of its schema."""

    schema_: Literal[1] = Field(alias="schema")

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
        except ValidationError as error:
            first = error.errors()[0]
            key = ".".join(map(str, first["loc"])) or "file"
            raise UserError(str(path), f"is no {what}: {key}: {first['msg'].lower()}", remedy) from None
