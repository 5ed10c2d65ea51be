"""Files of recordings by their content: copies left out, and the SHA-256 that results state of each."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.console import Console

from observer_rt.foundation.console import say
from observer_rt.foundation.errors import file_errors
from observer_rt.foundation.files import file_hash


def without_copies(paths: Sequence[Path], console: Console) -> list[Path]:
    """Recordings without copies of earlier ones, which are named; a file given twice stays, and is refused later."""
    sizes = []
    for path in paths:
        with file_errors(path):
            sizes.append(path.stat().st_size)
    kept: dict[str, Path] = {}
    result = []
    for path, size in zip(paths, sizes, strict=True):
        first = path
        if sizes.count(size) > 1:  # else it is no copy, and need not be read for that
            with file_errors(path):
                first = kept.setdefault(file_hash(path), path)
        if first.resolve() != path.resolve():
            say(console, f"warning: {path} is left out: a copy of {first}")
        else:
            result.append(path)
    return result


def hashes(paths: Sequence[Path]) -> dict[str, str]:
    """SHA-256 of recordings by file name, by path where two have one name."""
    names = Counter(path.name for path in paths)
    return {path.name if names[path.name] == 1 else str(path): file_hash(path) for path in paths}


def shortened(hashes: Mapping[str, str]) -> list[str]:
    """Recordings by name and the first digits of their SHA-256, as files state where their numbers are from."""
    return [f"{name} sha256 {digest[:12]}" for name, digest in hashes.items()]
