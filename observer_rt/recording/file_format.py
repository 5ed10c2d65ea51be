"""What every format of files says of itself."""

from dataclasses import dataclass


@dataclass(frozen=True)
class FileFormat:
    """A kind of file."""

    suffixes: tuple[str, ...]
    """Of its files, in lower case with their dot."""
    description: str
