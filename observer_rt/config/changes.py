"""What differs between two readings of a bench file and the files it names, in words."""

from collections.abc import Mapping
from typing import Any

from observer_rt.config.bench import Bench
from observer_rt.foundation.files import file_hash

_SHOWN = 8
Content = Mapping[str, Any]
"""All that a bench says, by the keys that lead to it; of databases what tells their content."""


def content_of(bench: Bench) -> Content:
    """What a bench says, with its injector files and databases as they are now."""
    said = _flat("", bench.config.model_dump())
    for injector in bench.injectors:
        prefix = f"injectors.{injector.name}." if injector.name else ""
        said |= _flat(prefix, injector.config.model_dump())
        said |= _flat(f"{prefix}{injector.parameters_path.name}: ", injector.parameters.model_dump())
    return said | {str(path): (file_hash(path),) for path in bench.databases}


def changes(before: Content, after: Content) -> list[str]:
    """Each key that says something else, with what it says."""
    pairs = {key: (before.get(key), after.get(key)) for key in [*before, *after]}
    found = [
        f"{key}: other content" if isinstance(now, tuple) else f"{key} {_shown(was)} -> {_shown(now)}"
        for key, (was, now) in pairs.items()
        if was != now
    ]
    return found if len(found) <= _SHOWN else [*found[:_SHOWN], f"{len(found) - _SHOWN} more"]


def _shown(value: Any) -> str:
    return "(left out)" if value is None else str(value)


def _flat(prefix: str, value: Any) -> dict[str, Any]:
    """Values by the keys that lead to them."""
    if not isinstance(value, Mapping):
        return {prefix: value}
    join = "." if prefix and not prefix.endswith((".", " ")) else ""
    parts = (_flat(f"{prefix}{join}{name}", below) for name, below in value.items())
    return {key: leaf for part in parts for key, leaf in part.items()}
