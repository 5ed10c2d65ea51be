"""TOML files of the user: read and validated; errors name file, key, remedy, and what may stand there instead."""

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from observer_rt.foundation.errors import UserError, did_you_mean

_KINDS = {
    "bool": "true or false, without quotes",
    "string": "a text in quotes",
    "tuple": "a list in brackets",
    "mapping": "a section",
    "model": "a section",
}
"""What an entry should be, by the type of a pydantic error; its own words serve for others."""

DEEPEST = 32  # sections and lists in one another, far more than any file needs
_LONG_KEY = re.compile(
    rf"""(?<![\w."'-])(?:(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{DEEPEST}}}"""
)

_Model = TypeVar("_Model", bound=BaseModel)


def validated(model: type[_Model], document: Mapping[str, Any], location_of: Callable[..., str], kind: str) -> _Model:
    """A document as a model; kind: as in `run --print-example-<kind>`, which prints a complete example.

    Types are strict; location_of: place of an entry, by keys. Raises `UserError` naming location, problem and remedy.
    """
    try:
        # as JSON, where a list is a tuple and a text a choice, however strict
        return model.model_validate_json(json.dumps(document, default=str), strict=True)
    except ValidationError as error:
        errors = error.errors()
        # a misspelt key also shows as a missing one: name the cause
        first: Any = next((e for e in errors if e["type"] == "extra_forbidden"), errors[0])
        keys = _keys(first["loc"], document, is_missing=first["type"] == "missing")
        if first["type"] == "extra_forbidden":
            section: type[BaseModel] = model  # that these keys lead to
            for key in keys[:-1]:
                if key in section.model_fields:
                    section = _section_in(section.model_fields[str(key)].annotation) or section
            raise unknown_key(location_of(*keys), str(keys[-1]), section.model_fields) from None
        raise UserError(location_of(*keys), *_explanation(first, kind)) from None


def _keys(location: Sequence[int | str], document: Any, is_missing: bool) -> list[int | str]:
    """Keys of a document in the location of a pydantic error, which also names choices between types."""
    keys: list[int | str] = []
    for part in location:
        is_key = isinstance(document, Mapping) and part in document
        is_item = isinstance(document, list) and isinstance(part, int) and part < len(document)
        if is_key or is_item:
            document = document[part]
            keys.append(part)
    return [*keys, location[-1]] if is_missing else keys


def _section_in(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    sections = (_section_in(argument) for argument in get_args(annotation))
    return next((section for section in sections if section is not None), None)


def location_in(path: Path) -> Callable[..., str]:
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
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
        if long := _LONG_KEY.search(text):  # for which the reader takes memory by the square of the names
            raise _too_deep(f"{path}:{1 + text[: long.start()].count(chr(10))}")
        document = tomllib.loads(text)
    except FileNotFoundError:
        raise UserError(str(path), "no such file", "correct the path") from None
    except OSError as error:
        raise UserError(str(path), f"cannot be read: {error.strerror}", "name a file") from None
    except UnicodeDecodeError as error:
        line = 1 + content[: error.start].count(b"\n")
        raise UserError(f"{path}:{line}", "is not UTF-8 text", "save it as UTF-8 in your editor") from None
    except RecursionError:
        lines = [len(re.findall(r"[\[{]", line)) for line in text.split("\n")]
        raise _too_deep(f"{path}:{1 + lines.index(max(lines))}") from None
    except ValueError as error:  # TOMLDecodeError, or a number of more digits than Python reads
        raise UserError(str(path), f"is not valid TOML: {error}", "mend the line named") from None
    for key, section in document.items():
        level: list[Any] = [[section]]
        for _ in range(DEEPEST + 1):
            inner = (each.values() if isinstance(each, dict) else each for each in level)
            level = [value for values in inner for value in values if isinstance(value, dict | list)]
        if level:
            raise _too_deep(f"{path}: {key}")
    return document


def _too_deep(location: str) -> UserError:
    return UserError(location, f"more than {DEEPEST} sections or lists are in one another", "no key lies so deep")


def _explanation(error: Any, kind: str) -> tuple[str, str]:
    """Problem and remedy for one pydantic error."""
    if error["type"] == "missing":
        return "is missing", f"add it; `observer-rt run --print-example-{kind}` shows a complete file"
    value = error.get("input")
    shown = f"{value!r} " if isinstance(value, str | int | float | bool) else ""
    if "[key]" in error["loc"]:  # pydantic's mark of a bad name
        return f"{shown}is not allowed as a name", "use letters, digits, '_', '-' and '.'"
    if error["type"] == "value_error":  # of ours, with a remedy
        problem, _, remedy = str(error["ctx"]["error"]).partition("; ")
        return f"{shown}is not allowed: {problem}", remedy or "correct it"
    expected = _KINDS.get(error["type"].removesuffix("_type"), "")
    if expected == _KINDS["tuple"] and isinstance(value, Mapping):
        expected = f"[[{error['loc'][-1]}]], with two brackets"
    choices = re.findall(r"'([^']*)'", str(error.get("ctx", {}).get("expected", "")))
    should = f"it should be {expected}" if expected else error["msg"].replace("Input", "it", 1)
    return f"{shown}is not allowed", f"{did_you_mean(str(value), choices)}{should}"
