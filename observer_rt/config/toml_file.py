"""TOML files of the user: read, validated, refused with file, key and remedy."""

import json
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from observer_rt.config.allowed import Allowed
from observer_rt.foundation.errors import UserError, did_you_mean

_Model = TypeVar("_Model", bound=BaseModel)


class Section(BaseModel):
    """A section of a file, of which unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def validated(
    model: type[_Model], document: Mapping[str, Any], place: Callable[..., str], kind: str
) -> _Model:
    """A document as a model. kind: of the complete example that `run --print-example-<kind>` prints.

    Nothing is taken for what it is not: no text for a number, no number for a switch. place: of what the keys that
    are its arguments lead to. Raises `UserError` naming place, problem and remedy.
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
            allowed = Allowed.at(model, section)
            raise unknown_key(place(*allowed.keys, key), key, allowed.names) from None
        allowed = Allowed.at(model, first["loc"])
        raise UserError(place(*allowed.keys), *_explanation(first, allowed, kind)) from None


def place_in(path: Path) -> Callable[..., str]:
    """What `validated` calls the places of a file."""
    return lambda *location: f"{path}: {'.'.join(map(str, location)) or 'file'}"


def unknown_key(place: str, key: str, known: Iterable[str]) -> UserError:
    """The error of a key that is none of the known ones."""
    names = list(known)
    return UserError(place, "unknown key", f"{did_you_mean(key, names)}known keys: {', '.join(names)}")


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


def _explanation(error: Any, allowed: Allowed, kind: str) -> tuple[str, str]:
    """Problem and remedy for one pydantic error."""
    if error["type"] == "missing":
        example = f"`observer-rt run --print-example-{kind}` shows a complete file"
        return "is missing", f"add it, {allowed.in_words()}; {example}"
    found = error.get("input")
    shown = f"{found!r} " if isinstance(found, str | int | float | bool) else ""
    if "[key]" in error["loc"]:  # pydantic's mark of a bad name
        return f"{shown}is not allowed as a name", "use letters, digits, '_', '-' and '.'"
    if error["type"] == "value_error":  # of ours, with a remedy
        problem, _, remedy = str(error["ctx"]["error"]).partition("; ")
        return f"{shown}is not allowed: {problem}", remedy or "correct it"
    meant = did_you_mean(str(found), allowed.choices)
    return f"{shown}is not allowed", f"{meant}write {allowed.in_words()}"
