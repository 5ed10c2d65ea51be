"""FMUs for co-simulation, FMI 2.0 and 3.0: sources, and the library where there is a compiler."""

import uuid
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from observer_rt.desk.export.c_code import REPLAY, c_sources, source
from observer_rt.desk.export.compiler import binary, compile_c, compiler
from observer_rt.desk.export.frozen import Frozen
from observer_rt.desk.export.model_description import build_description, model_description
from observer_rt.foundation.outputs import replacing

WRAPPERS = ("fmi.h", "unit.h", "unit_step.c")
_EPOCH = (1980, 1, 1, 0, 0, 0)  # of files in an archive: the same export gives the same bytes
_NAMESPACE = uuid.UUID("8e1a5f4e-3d0c-4d53-9a0e-0c5f6f8a7b21")


def write_fmu(path: Path, frozen: Frozen, content: str, version: int) -> bool:
    """An FMU; content: a key of `CONTENTS`; version: 2 or 3. Whether it has a library for this machine.

    Raises `RunError` where a compiler is there and fails.
    """
    sources = dict(c_sources(frozen, single=False))
    del sources[REPLAY]
    for name in (*WRAPPERS, f"unit_{content}.c", f"fmi{version}.c"):
        sources[name] = source(name)
    token = str(
        uuid.uuid5(_NAMESPACE, f"{content} {version}\n" + "\n".join(map(str, sorted(sources.items()))))
    )
    sources["unit_token.h"] = f'/* Of this export. */\n#define TOKEN "{token}"\n'
    compiled = sorted(name for name in sources if name.endswith(".c"))
    found, machine = compiler(), binary()
    with replacing(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        description = model_description(frozen, content, version, token, compiled)
        _put(archive, "modelDescription.xml", description)
        for name, text in sorted(sources.items()):
            _put(archive, f"sources/{name}", text.encode())
        if version == 3:
            _put(archive, "sources/buildDescription.xml", build_description(content, compiled))
        if found is None or machine is None:
            return False
        folder = machine.fmi2 if version == 2 else machine.fmi3
        library = _library(found, sources, compiled)
        _put(archive, f"binaries/{folder}/{content}{machine.suffix}", library)
    return True


def _library(found: str, sources: Mapping[str, str], compiled: Sequence[str]) -> bytes:
    with TemporaryDirectory() as folder:
        for name, text in sources.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        output = Path(folder) / "library"
        compile_c(found, Path(folder), compiled, output, "-shared", "-fPIC", "-fvisibility=hidden")
        return output.read_bytes()


def _put(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    entry = zipfile.ZipInfo(name, _EPOCH)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    archive.writestr(entry, content)
