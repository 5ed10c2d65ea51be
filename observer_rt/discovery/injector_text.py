"""The amended injector file: the file given, with the effects found added."""

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tomlkit

from observer_rt.config.bench import load_injector
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.model.parameters import EffectInForce, EffectValue

_HEADER = re.compile(r"^\s*\[")
_EFFECT_HEADER = re.compile(r"^\s*\[\[?\s*effects\b")


class InjectorText:
    """An injector file as text: all of it but its effects, so that comments and layout stay."""

    def __init__(self, path: Path) -> None:
        """Raises `UserError` for effects written in another way than as [[effects]] tables."""
        text = path.read_text(encoding="utf-8")
        self.without_effects = "".join(_other_lines(text.splitlines(keepends=True)))
        expected = {key: value for key, value in tomllib.loads(text).items() if key != "effects"}
        if _parsed(self.without_effects) != expected:
            raise UserError(
                f"{path}: effects",
                "are not written as [[effects]] tables, so that no effect can be added",
                'write each as [[effects]] with id = "..." and parameters = { ... } below it',
            )

    def with_effects(self, effects: Sequence[EffectInForce], cells: int | None = None) -> str:
        """The file with these effects, and no others, at its end. cells: that its line states, None: as it is."""
        text = self.without_effects
        if cells is not None:
            document = tomlkit.parse(text)
            document["line"].update({"cells": cells})
            text = tomlkit.dumps(document)
        return text.rstrip("\n") + "\n" + "".join(f"\n{_table(one)}" for one in effects)


def write_amended(
    path: Path, source: InjectorText, effects: Sequence[EffectInForce], cells: int | None = None
) -> None:
    """Write the amended file and see that it loads. cells: as of `InjectorText.with_effects`.

    Raises `RunError` when it would not be taken back.
    """
    path.write_text(source.with_effects(effects, cells), encoding="utf-8")
    try:
        load_injector(path)
    except UserError as error:
        raise RunError(f"{path}: the amended model would not load: {error.problem}") from None


def _parsed(text: str) -> dict[str, Any] | None:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return None


def _other_lines(lines: Sequence[str]) -> list[str]:
    """Lines outside [[effects]] tables and their sub-tables."""
    kept = []
    inside = False
    for line in lines:
        if _HEADER.match(line):
            inside = bool(_EFFECT_HEADER.match(line))
        if not inside:
            kept.append(line)
    return kept


def _table(effect: EffectInForce) -> str:
    lines = ["[[effects]]", f"id = {_quoted(effect.id)}"]
    if effect.parameters:
        values = ", ".join(f"{name} = {_value(value)}" for name, value in effect.parameters.items())
        lines.append(f"parameters = {{ {values} }}")
    for key in ("origin", "evidence", "date"):
        text = getattr(effect, key)
        if text:
            lines.append(f"{key} = {_quoted(text)}")
    return "\n".join(lines) + "\n"


def _value(value: EffectValue) -> str:
    interval = "" if value.ci95 is None else f"ci95 = [{value.ci95[0]!r}, {value.ci95[1]!r}], "
    return f"{{ value = {value.value!r}, {interval}unit = {_quoted(value.unit)} }}"


def _quoted(text: str) -> str:
    """A basic string of TOML."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + re.sub(r"[\x00-\x1f\x7f]", lambda m: f"\\u{ord(m[0]):04x}", escaped) + '"'
