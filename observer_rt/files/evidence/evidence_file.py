"""One event's evidence as a Parquet file, in our own layout of a recording, with what was believed of it beside."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from observer_rt.engine.reports.evidence import EventEvidence, EvidenceKind
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.table_writers import SI, ParquetWriter
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND

SUFFIX = ".parquet"
_BELIEF = "observer_rt_evidence"


@dataclass(frozen=True, eq=False)
class KeptEvent:
    """An event that was kept: its recording, and what was believed of it; time: of the verdict, ISO 8601.

    sha256: of the file as it was read, hexadecimal.
    """

    path: Path
    sha256: str
    kind: EvidenceKind
    time: str
    open_time: float
    opening_pressure: float
    belief: dict[str, Any]
    recording: Recording


def operating_point(evidence: EventEvidence) -> str:
    """The operating point in the name of a file: rail pressure and time open, rounded as discovery does."""
    pressure = 5 * round(evidence.opening_pressure / (5 * MEGAPASCAL))
    return f"{pressure}MPa_{100 * round(evidence.open_time / (100 * MICROSECOND))}us"


def write_evidence(path: Path, evidence: EventEvidence, time: str) -> None:
    """Write it; time: of the verdict, ISO 8601."""
    said = {
        "kind": evidence.kind.value,
        "time": time,
        "event": evidence.event,
        "first_index": evidence.first_index,
        "opening_pressure_Pa": evidence.opening_pressure,
        "open_time_s": evidence.open_time,
        "belief": evidence.belief,
    }
    samples = (evidence.first_index + np.arange(evidence.rail_pressure.size)) / evidence.sample_rate
    with ParquetWriter(path, SI[:4], {_BELIEF: json.dumps(said)}) as writer:
        writer.write([samples, *evidence.signals])


def read_evidence(path: Path) -> KeptEvent:
    """Read an event that `write_evidence` wrote. Raises `UserError` for a damaged file, or another."""
    from pyarrow import ArrowException, parquet

    remedy = "move it out of the folder; the others are used"
    with file_errors(path):
        try:
            with path.open("rb") as file:  # a name may look like an address to the library
                sha256 = hashlib.file_digest(file, "sha256").hexdigest()
                table = parquet.read_table(file, page_checksum_verification=True)
            said = json.loads(table.schema.metadata[_BELIEF.encode()])
            time, rail, lift, line = (table.column(column.header).to_numpy() for column in SI[:4])
            recording = Recording(time, rail, lift, line, path=path)
            return KeptEvent(
                path,
                sha256,
                EvidenceKind(said["kind"]),
                str(said["time"]),
                float(said["open_time_s"]),
                float(said["opening_pressure_Pa"]),
                dict(said["belief"]),
                recording,
            )
        except OSError as error:  # of a page whose checksum is another
            raise UserError(str(path), f"is damaged: {error}", remedy) from None
        except (ArrowException, KeyError, ValueError, TypeError):
            raise UserError(str(path), "is no evidence kept by `observer-rt run`", remedy) from None
