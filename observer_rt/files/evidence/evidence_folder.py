"""A bounded folder of evidence: by kind, operating point and model the newest, of good events a fair sample.

An event's lot is a hash of its file's name, and of good events those with the lowest lots stay: a fair sample of all
the time that the model was in force, however often the writer was started anew.
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
    """Bounds of a folder: MiB of all files, and how many of a kind and model at one operating point."""

    most_mib: float
    per_point: int


class EvidenceFolder:
    """Takes evidence in, and drops what it takes the place of; a file is whole or not there, whenever power fails."""

    def __init__(self, path: Path, limits: FolderLimits) -> None:
        """Raises OSError where the folder cannot be made."""
        path.mkdir(parents=True, exist_ok=True)
        self._path = path
        for left in self._own(f".*{SUFFIX}"):  # of a writer that was killed
            left.unlink()
        self._limits = limits

    def take(self, evidence: EventEvidence, time: datetime) -> str:
        """Keep an event: the name of its file, empty where others stay instead of it. time: UTC. Raises OSError."""
        self._path.mkdir(parents=True, exist_ok=True)  # somebody may have removed it
        cell = f"{evidence.kind}_{operating_point(evidence)}_{evidence.belief['model_sha256'][:MODEL_DIGITS]}"
        name = f"{cell}_{time:%Y%m%dT%H%M%S%f}{SUFFIX}"
        kept = [path.name for path in self._own(f"{cell}_*{SUFFIX}")]
        staying = _staying([*kept, name], self._limits.per_point)
        if name not in staying:
            return ""
        self._write(self._path / name, evidence, time)
        for dropped in set(kept) - set(staying):
            (self._path / dropped).unlink(missing_ok=True)
        self._make_room(name)
        return name

    def _write(self, target: Path, evidence: EventEvidence, time: datetime) -> None:
        with replacing(target) as part:
            write_evidence(part, evidence, time.isoformat(timespec="milliseconds"))

    def _own(self, pattern: str) -> list[Path]:
        """Files that a keeper of evidence named: no other is dropped, or counts."""
        return [path for path in self._path.glob(pattern) if _NAME.fullmatch(path.name)]

    def _make_room(self, newest: str) -> None:
        """Drop files until all fit, of the cell that has most; the newest never."""
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
    """Files of one cell that stay, where only so many may: the newest, of good events those with the lowest lots."""
    if names[0].startswith(f"{EvidenceKind.GOOD}_"):
        return sorted(names, key=lambda name: sha256(name.encode()).digest())[:most]
    return sorted(names, reverse=True)[:most]
