"""Results on disk, one JSON line a case, so that an interrupted run goes on where it stopped."""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Generic, TypeVar

from pydantic import TypeAdapter, ValidationError

Score = TypeVar("Score")


def digest_of(sources: Iterable[Path]) -> str:
    """Digest of Python files, and of all in folders: results belong to one state of the code."""
    digest = hashlib.sha256()
    for source in sources:
        for path in sorted(source.rglob("*.py")) if source.is_dir() else [source]:
            digest.update(path.relative_to(source).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


class Store(Generic[Score]):
    """A file of scores of one type; lines of another state of the code, or cut short, do not count."""

    def __init__(self, path: Path, score_type: type[Score], digest: str) -> None:
        """The folder is made when the first score is added."""
        self._path = path
        self._adapter = TypeAdapter(score_type)
        self._digest = digest

    def load(self) -> list[Score]:
        """All scores of this state of the code."""
        if not self._path.exists():
            return []
        scores = []
        for line in self._path.read_text().splitlines():
            try:
                entry = json.loads(line)
                if entry["digest"] == self._digest:
                    scores.append(self._adapter.validate_python(entry["score"]))
            except (json.JSONDecodeError, KeyError, TypeError, ValidationError):
                continue  # the line an interrupted run was writing
        return scores

    def add(self, score: Score) -> None:
        """Append one score and flush it."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        cut_short = self._path.exists() and not self._path.read_bytes().endswith(b"\n")
        with self._path.open("a") as file:
            if cut_short:
                file.write("\n")
            file.write(json.dumps({"digest": self._digest, "score": asdict(score)}) + "\n")  # type: ignore[call-overload]
