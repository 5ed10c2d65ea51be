"""A folder of evidence with bounds: it keeps the newest events of each kind, operating point and model.

Of good events it keeps a fair sample of all the time that the model was in force. Each draws a lot, the hash of its
file's name, and those with the lowest lots stay, so that a restart of the writer changes nothing.
"""

import re
from collections import Counter
from dataclasses import dataclass
from datetime import datetime
from hashlib import sha256
from pathlib import Path

from observer_rt.engine.reports.evidence import EventEvidence, EvidenceKind
from observer_rt.files.evidence.evidence_file import SUFFIX, operating_point, write_evidence
from observer_rt.foundation.outputs import replacing

MODEL_DIGITS = 8  # of the SHA-256 of a model, in the names of its files
_MIB = 1 << 20
_NAME = re.compile(
    rf"\.?({'|'.join(EvidenceKind)})_-?\d+MPa_\d+us_[0-9a-f]{{8}}_\d{{8}}T\d{{12}}"
    rf"(\.[0-9a-f]{{8}}\.part)?{re.escape(SUFFIX)}"
)


@dataclass(frozen=True)
class FolderLimits:
    """Bounds of a folder: the size of all files [MiB], and files of one kind and model at one operating point."""

    most_mib: float
    per_point: int


class EvidenceFolder:
    """Keeps evidence, and deletes what it replaces. After a power failure each file is either whole or absent."""

    def __init__(self, path: Path, limits: FolderLimits) -> None:
        """Raises OSError where the folder cannot be made."""
        path.mkdir(parents=True, exist_ok=True)
        self._path = path
        for left in self._own(f".*{SUFFIX}"):  # of a writer that was killed
            left.unlink()
        self._limits = limits

    def take(self, evidence: EventEvidence, time: datetime) -> str:
        """Keep an event; returns the name of its file, empty if it is not kept. time: UTC. Raises OSError."""
        self._path.mkdir(parents=True, exist_ok=True)  # somebody may have removed it
        cell = f"{evidence.kind}_{operating_point(evidence)}_{evidence.belief['model_sha256'][:MODEL_DIGITS]}"
        name = f"{cell}_{time:%Y%m%dT%H%M%S%f}{SUFFIX}"
        kept = [path.name for path in self._own(f"{cell}_*{SUFFIX}")]
        staying = _staying([*kept, name], self._limits.per_point)
        if name not in staying:
            return ""
        with replacing(self._path / name) as part:
            write_evidence(part, evidence, time.isoformat(timespec="milliseconds"))
        for dropped in set(kept) - set(staying):
            (self._path / dropped).unlink(missing_ok=True)
        self._make_room(name)
        return name

    def _own(self, pattern: str) -> list[Path]:
        """Files that carry a name of evidence; others are neither counted nor deleted."""
        return [path for path in self._path.glob(pattern) if _NAME.fullmatch(path.name)]

    def _make_room(self, newest: str) -> None:
        """Delete files until the rest fits, from the cell that has most of them; never the newest file."""
        sizes = {path: path.stat().st_size for path in self._own(f"*{SUFFIX}")}
        while sum(sizes.values()) > self._limits.most_mib * _MIB:
            cells = Counter(path.name.rsplit("_", 1)[0] for path in sizes if path.name != newest)
            if not cells:
                return
            most, count = cells.most_common(1)[0]
            names = [path.name for path in sizes if path.name.startswith(f"{most}_") and path.name != newest]
            (dropped,) = set(names) - set(_staying(names, count - 1))
            (self._path / dropped).unlink(missing_ok=True)
            del sizes[self._path / dropped]


def _staying(names: list[str], most: int) -> list[str]:
    """The files of one cell to be kept, `most` of them: the newest, or those of good events with the lowest lots."""
    if names[0].startswith(f"{EvidenceKind.GOOD}_"):
        return sorted(names, key=lambda name: sha256(name.encode()).digest())[:most]
    return sorted(names, reverse=True)[:most]
