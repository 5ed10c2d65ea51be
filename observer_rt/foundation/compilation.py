"""Where compiled code is kept between runs.

Numba notices a change of the file a function stands in, but not of the files it calls into. So the cache of every
state of the compiled source gets a folder of its own, named by a digest of the modules that use Numba and of all they
import from the package: a change of a report or of a command compiles nothing anew.
"""

import contextlib
import hashlib
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

_VARIABLE = "NUMBA_CACHE_DIR"
_PACKAGE = Path(__file__).parents[1]
_USES_NUMBA = re.compile(r"^(?:from|import) numba\b", re.MULTILINE)
_IMPORTED = re.compile(
    rf"^\s*(?:from|import) {_PACKAGE.name}\.([\w.]+)(?: import \(?([\w, ]*))?", re.MULTILINE
)
_KEEP_UNUSED = 14 * 24 * 3600  # s, for which the cache of another state of the source is kept


def use_own_cache() -> None:
    """Point Numba to the cache folder of this source; to be called before Numba is imported."""
    name = compiled_digest()[:16]
    if Path(os.environ.get(_VARIABLE, "")).name == name:
        return  # set by the process that started this one
    root = _writable_root()
    folder = root / name
    folder.mkdir(exist_ok=True)
    _remove_unused(root, folder)
    os.environ[_VARIABLE] = str(folder)
    if "numba" in sys.modules:  # it has read its settings already
        sys.modules["numba"].config.CACHE_DIR = str(folder)


def source_digest() -> str:
    """SHA-256 (hexadecimal) of the package's source: two states of it never have the same."""
    return _digest(_PACKAGE.rglob("*.py"))


def compiled_digest() -> str:
    """SHA-256 (hexadecimal) of the source that compiled code can depend on."""
    sources = {path: path.read_text("utf-8") for path in _PACKAGE.rglob("*.py")}
    waiting = [path for path, text in sources.items() if _USES_NUMBA.search(text)]
    found = set(waiting)
    while waiting:
        for path in _imported_by(sources[waiting.pop()]) & sources.keys() - found:
            found.add(path)
            waiting.append(path)
    return _digest(found)


def _imported_by(text: str) -> set[Path]:
    """The files a module's text may import from the package."""
    result = set()
    for module, names in _IMPORTED.findall(text):
        path = _PACKAGE.joinpath(*module.split("."))
        result |= {path.with_suffix(".py"), path / "__init__.py"}
        result |= {path / f"{name.split()[0]}.py" for name in names.split(",") if name.strip()}
        if not names:  # a list in parentheses: any module of the folder
            result |= set(path.glob("*.py"))
    return result


def _digest(paths: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for path in sorted(paths):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def is_compiled() -> bool:
    """Whether anything of this source was compiled before."""
    return any(Path(os.environ[_VARIABLE]).rglob("*.nbi"))


def _writable_root() -> Path:
    """The user's own cache folder, else one of the temporary folder."""
    chosen = os.environ.get(_VARIABLE)
    cache = Path(chosen) if chosen else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    root = cache / "observer_rt" / "compiled"
    try:
        root.mkdir(parents=True, exist_ok=True)
        if os.access(root, os.W_OK):
            return root
    except OSError:
        pass
    root = Path(tempfile.gettempdir()) / f"observer_rt-{os.getuid()}"
    root.mkdir(exist_ok=True)
    return root


def _remove_unused(root: Path, used: Path) -> None:
    os.utime(used)
    for folder in root.iterdir():
        with contextlib.suppress(FileNotFoundError):  # another process may remove it at the same time
            if time.time() - folder.stat().st_mtime > _KEEP_UNUSED:
                shutil.rmtree(folder, ignore_errors=True)
