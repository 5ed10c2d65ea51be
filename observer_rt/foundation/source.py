"""The state of the package's source, by which stored results know whether they still hold."""

import hashlib
from pathlib import Path

_PACKAGE = Path(__file__).parents[1]
_SUFFIXES = (".py", ".pyx", ".pxd", ".pxi")


def source_digest() -> str:
    """SHA-256 (hexadecimal) of the package's source: two states of it never have the same."""
    digest = hashlib.sha256()
    for path in sorted(each for each in _PACKAGE.rglob("*.p*") if each.suffix in _SUFFIXES):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()
