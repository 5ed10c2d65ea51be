"""Runs of `discover` side by side: verdicts, sizes and gaps, and what changed from the first to the last."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.file_errors import file_errors

FINDINGS = "findings.json"
SCHEMA = 1
_REMEDY = "name a folder that `observer-rt discover --out` of this version wrote"


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False)


class Size(_Part):
    """A parameter with its 95 % interval, in its printed unit."""

    value: float
    ci95: tuple[float, float]
    unit: str


class NamedEffect(_Part):
    """An effect that was found."""

    id: str
    parameters: dict[str, Size]


class CaveatWords(_Part):
    """A reservation in a few words."""

    words: str


class Model(_Part):
    """The injector file the run began with."""

    file: str
    sha256: str
    in_force: tuple[str, ...]


class Document(_Part):
    """What is compared of a findings.json."""

    schema_: Literal[1]
    verdict: str
    confidence: float
    caveats: tuple[CaveatWords, ...]
    effects: tuple[NamedEffect, ...]
    rivals: tuple[tuple[str, ...], ...]
    gap: dict[str, dict[str, float | bool | None] | None]
    model: Model
    recordings: dict[str, str]


@dataclass(frozen=True)
class Run:
    """An answer, by the name of its folder as the user gave it."""

    name: str
    document: Document

    @classmethod
    def read(cls, path: Path) -> Self:
        """The run whose folder, or findings.json, this is. Raises `UserError` for what is none."""
        file = path / FINDINGS if path.is_dir() else path
        with file_errors(file):
            text = file.read_bytes()
        try:
            content = json.loads(text)
            content = {**content, "schema_": content.get("schema")}
            return cls(str(path), Document.model_validate(content))
        except (ValueError, RecursionError, AttributeError, TypeError) as error:
            raise UserError(str(file), f"is no findings of a run: {_reason(error)}", _REMEDY) from None

    def sizes(self) -> dict[tuple[str, str], Size]:
        """Sizes by effect and parameter."""
        effects = self.document.effects
        return {(one.id, name): size for one in effects for name, size in one.parameters.items()}


@dataclass(frozen=True)
class Change:
    """How a size changed from one run to another, with the half width of its 95 % interval."""

    effect: str
    parameter: str
    unit: str
    change: float
    half: float

    @property
    def is_significant(self) -> bool:
        """Whether it is beyond its interval."""
        return abs(self.change) > self.half


def changes(before: Run, after: Run) -> tuple[Change, ...]:
    """Of every size that both runs found, with one meaning: they began with the same model."""
    if before.document.model.sha256 != after.document.model.sha256:
        return ()
    old, new = before.sizes(), after.sizes()
    return tuple(
        Change(
            *key,
            unit=size.unit,
            change=new[key].value - size.value,
            half=math.hypot(_half(size), _half(new[key])),
        )
        for key, size in old.items()
        if key in new and new[key].unit == size.unit
    )


def as_json(runs: Sequence[Run]) -> dict[str, Any]:
    """The comparison as a document: every run, and the changes from the first to the last."""
    return {
        "schema": SCHEMA,
        "runs": [
            {"run": run.name, **run.document.model_dump(mode="json", exclude={"schema_"})} for run in runs
        ],
        "changes": [
            {
                "effect": one.effect,
                "parameter": one.parameter,
                "unit": one.unit,
                "change": one.change,
                "ci95": [one.change - one.half, one.change + one.half],
                "significant": one.is_significant,
            }
            for one in changes(runs[0], runs[-1])
        ],
    }


def _half(size: Size) -> float:
    low, high = size.ci95
    return max(size.value - low, high - size.value)


def _reason(error: Exception) -> str:
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"])).replace("schema_", "schema")
        return f"{key}: {str(first['msg']).lower()}"
    return str(error)
