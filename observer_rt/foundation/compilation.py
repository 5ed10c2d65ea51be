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
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

_VARIABLE = "NUMBA_CACHE_DIR"
_PACKAGE = Path(__file__).parents[1]
_USES_NUMBA = re.compile(r"^(?:from|import) numba\b", re.MULTILINE)
_IMPORTED = re.compile(
    rf"^\s*(?:from|import) {_PACKAGE.name}\.([\w.]+)(?: import \(?([\w, ]*))?", re.MULTILINE
)
_ROOM = 200 << 20  # bytes, twice what a bench takes
_SHARED_MEMORY = Path("/dev/shm")
_KEEP_UNUSED = 14 * 24 * 3600  # s, for which the cache of another state of the source is kept


@dataclass(frozen=True)
class CompiledCode:
    """Where it is kept. folder: None where there is none, so that nothing can be compiled.

    trouble, remedy: what keeps it from the folder wanted and what that costs, what mends it; empty if nothing does.
    """

    folder: Path | None
    trouble: str = ""
    remedy: str = ""


_kept = CompiledCode(None)


def compiled_code() -> CompiledCode:
    """Where this process keeps it."""
    return _kept


def use_own_cache() -> None:
    """Point Numba to the cache folder of this source; to be called before Numba is imported.

    Where the one wanted cannot be written, to one that the next start of the computer empties: see `compiled_code`.
    """
    global _kept
    name = compiled_digest()[:16]
    if Path(os.environ.get(_VARIABLE, "")).name == name:
        _kept = CompiledCode(Path(os.environ[_VARIABLE]))
        return  # set by the process that started this one
    _kept = _first_usable(name)
    if _kept.folder is None:
        return
    _remove_unused(_kept.folder.parent, _kept.folder)
    os.environ[_VARIABLE] = str(_kept.folder)
    if "numba" in sys.modules:  # it has read its settings already
        sys.modules["numba"].config.CACHE_DIR = str(_kept.folder)


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


def is_kept(function: str) -> bool:
    """Whether code of a compiled function, `module.name`, is in the cache."""
    return any(Path(os.environ[_VARIABLE]).rglob(f"{function}-*.nbi"))


def note_complete(work: str) -> None:
    """Remember that all code is in the cache that a kind of work needs: it was done."""
    Path(os.environ[_VARIABLE], f"{work}.complete").touch()


def is_complete(work: str) -> bool:
    """Whether a kind of work was done with this state of the source: it compiles nothing any more."""
    return Path(os.environ[_VARIABLE], f"{work}.complete").exists()


def _first_usable(name: str) -> CompiledCode:
    """The folder `name` in the user's own cache, else in a temporary one."""
    chosen = os.environ.get(_VARIABLE)
    cache = Path(chosen) if chosen else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    wanted = cache / "observer_rt" / "compiled"
    obstacle = _obstacle(wanted / name)
    if not obstacle:
        return CompiledCode(wanted / name)
    remedy = f"mend its rights or make room, or name another folder: {_VARIABLE}=FOLDER observer-rt ..."
    for root in _substitutes():
        if not (_foreign(root) or _obstacle(root / name)):
            trouble = (
                f"compiled code cannot be kept in {wanted} ({obstacle}): it is in {root}, and after every start of "
                "the computer `run` is ready only when all is compiled anew, which takes a minute or two"
            )
            return CompiledCode(root / name, trouble, remedy)
    return CompiledCode(
        None, f"compiled code can be kept neither in {wanted} ({obstacle}) nor elsewhere", remedy
    )


def _substitutes() -> Iterator[Path]:
    name = f"observer_rt-{os.getuid()}"
    with contextlib.suppress(FileNotFoundError):  # there is no temporary folder
        yield Path(tempfile.gettempdir()) / name
    yield _SHARED_MEMORY / name


def _foreign(root: Path) -> bool:
    """Whether another user made a folder where anybody may make one: what is in there would be run."""
    with contextlib.suppress(OSError):
        root.mkdir(mode=0o700, exist_ok=True)
        return root.stat().st_uid != os.getuid()
    return False


def _obstacle(folder: Path) -> str:
    """What keeps compiled code from being written, empty if nothing does."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        return error.strerror or str(error)
    room = shutil.disk_usage(folder).free
    if room < _ROOM and not any(folder.rglob("*.nbi")):
        return f"{room >> 20} MB are free there, it takes {_ROOM >> 20}"
    return ""


def _remove_unused(root: Path, used: Path) -> None:
    os.utime(used)
    for folder in root.iterdir():
        with contextlib.suppress(FileNotFoundError):  # another process may remove it at the same time
            if time.time() - folder.stat().st_mtime > _KEEP_UNUSED:
                shutil.rmtree(folder, ignore_errors=True)
