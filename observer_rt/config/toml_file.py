"""TOML files of the user: read, validated, refused with file, key and remedy."""

import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError

from observer_rt.foundation.errors import UserError, did_you_mean

_Model = TypeVar("_Model", bound=BaseModel)


class Section(BaseModel):
    """A section of a file, of which unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def validated(
    model: type[_Model], document: Mapping[str, Any], place: Callable[..., str], kind: str
) -> _Model:
    """A document as a model. kind: of the complete example that `run --print-example-<kind>` prints.

    place: of what the keys that are its arguments lead to. Raises `UserError` naming place, problem and remedy.
    """
    try:
        return model.model_validate(document)
    except ValidationError as error:
        errors = error.errors()
        # a misspelt key also shows as a missing one: name the cause
        first = next((e for e in errors if e["type"] == "extra_forbidden"), errors[0])
        location = tuple(part for part in first["loc"] if part != "[key]")  # pydantic's mark of a bad name
        if first["type"] == "extra_forbidden":
            known = _keys_at(model, location[:-1])
            raise unknown_key(place(*location), str(location[-1]), known) from None
        raise UserError(place(*location), *_explanation(first, kind)) from None


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
        with path.open("rb") as file:
            return tomllib.load(file)
    except FileNotFoundError:
        raise UserError(str(path), "no such file", "correct the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(str(path), f"cannot be read: {error}") from None
    except RecursionError:
        raise UserError(str(path), "is not valid TOML: nested too deeply", "mend it") from None
    except ValueError as error:  # TOMLDecodeError, or a number of more digits than Python reads
        raise UserError(str(path), f"is not valid TOML: {error}", "mend the line named") from None


def _explanation(error: Any, kind: str) -> tuple[str, str]:
    """Problem and remedy for one pydantic error."""
    if error["type"] == "missing":
        return "is missing", f"add it; `observer-rt run --print-example-{kind}` shows a complete file"
    message = str(error["msg"]).removeprefix("Value error, ")
    found = error.get("input")
    shown = f"{found!r} " if isinstance(found, str | int | float | bool) else ""
    return f"{shown}is not allowed: {message[:1].lower()}{message[1:]}", "correct the value"


def _keys_at(model: type[BaseModel], location: tuple[Any, ...]) -> list[str]:
    """Names of the keys a section may have; `location` leads to it through nested sections and lists."""
    names_follow = False  # the next part is a name the user chose, not one of ours
    for part in location:
        if isinstance(part, int) or names_follow:
            names_follow = False
            continue
        annotation = model.model_fields[part].annotation
        names_follow = get_origin(annotation) is Mapping
        model = _section_in(annotation)
    return list(model.model_fields)


def _section_in(annotation: Any) -> type[BaseModel]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    if get_origin(annotation) in (tuple, Union, UnionType):
        return _section_in(get_args(annotation)[0])
    if get_origin(annotation) is Mapping:
        return _section_in(get_args(annotation)[1])
    raise TypeError(f"not a section: {annotation}")
