"""Where compiled code is kept between runs.

Numba notices a change of the file a function stands in, but not of the files it calls into. So a unit, a folder of
the package with modules that use Numba, has a cache folder for every state of its source and of the units it imports,
named by a digest of them: an edit compiles its unit and those above it, one of plain Python nothing.
`foundation.unit_cache` tells Numba.
"""

import contextlib
import functools
import gc
import hashlib
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

_VARIABLE, _LOCATORS = "NUMBA_CACHE_DIR", "NUMBA_CACHE_LOCATOR_CLASSES"
_PACKAGE = Path(__file__).parents[1]
_USES_NUMBA = re.compile(rf"^(?:from|import) (?:numba|{_PACKAGE.name}\.foundation\.compiled)\b", re.MULTILINE)
_IMPORTED = re.compile(
    rf"^\s*(?:from|import) {_PACKAGE.name}\.([\w.]+)(?: import \(?([\w, ]*))?", re.MULTILINE
)
_ROOM = 200 << 20  # bytes, twice what a bench takes
_SHARED_MEMORY = Path("/dev/shm")
_KEEP_UNUSED = 14 * 24 * 3600  # s, for which the cache of another state of the source is kept
_FOLDER = "compiled"
_DIGITS = 16  # of a digest in a folder's name
_ELSEWHERE = "elsewhere"  # the unit of functions outside the package


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
    """Point Numba to the cache of this package; to be called before Numba is imported.

    Where the folder wanted cannot be written, to one that the next start of the computer empties.
    """
    global _kept
    _kept = _inherited() or _first_usable()
    if _kept.folder is None:
        return
    os.environ[_VARIABLE] = str(_kept.folder)
    os.environ[_LOCATORS] = f"{_PACKAGE.name}.foundation.unit_cache.UnitCacheLocator"
    if "numba" in sys.modules:  # it has read its settings already
        config = sys.modules["numba"].config
        config.CACHE_DIR, config.CACHE_LOCATOR_CLASSES = os.environ[_VARIABLE], os.environ[_LOCATORS]


def collect_seldom() -> None:
    """Look for garbage after 50,000 objects instead of 700.

    Starting and compiling make millions that stay: a tenth of the time goes by looking through them again and again.
    """
    gc.set_threshold(50_000, 5, 2)


def unit_of(file: str) -> str:
    """The unit of a source file."""
    path = Path(file)
    return path.relative_to(_PACKAGE).parts[0] if path.is_relative_to(_PACKAGE) else _ELSEWHERE


@functools.cache
def unit_folder(root: str, unit: str) -> Path:
    """Where in the cache the code of a unit's state now is kept; made where it is missing."""
    folder = Path(root) / _name(unit)
    if not folder.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        _remove_unused(folder.parent)
    os.utime(folder)
    return folder


def _name(unit: str) -> str:
    return f"{unit}-{_unit_digests()[unit][:_DIGITS]}"


def source_digest() -> str:
    """SHA-256 (hexadecimal) of the package's source: two states of it never have the same."""
    return _digest(_PACKAGE.rglob("*.py"))


@functools.cache
def _unit_digests() -> dict[str, str]:
    """SHA-256 (hexadecimal) of the source that the compiled code of each unit can depend on.

    Whole units count, imported or not: of two units' types and functions one meets the other at run time.
    """
    sources = {path: path.read_text("utf-8") for path in _PACKAGE.rglob("*.py")}
    imported = functools.cache(lambda path: _imported_by(sources[path]) & sources.keys())
    modules: dict[str, set[Path]] = {}
    for path, text in sources.items():
        if _USES_NUMBA.search(text):
            modules.setdefault(unit_of(str(path)), set()).add(path)
    whole = {unit: _reached(paths, imported) for unit, paths in modules.items()}
    compiled = set().union(*modules.values())
    below = {unit: {unit_of(str(path)) for path in paths & compiled} for unit, paths in whole.items()}
    files = {unit: set().union(*(whole[each] for each in below[unit])) for unit in whole}
    files[_ELSEWHERE] = set().union(*whole.values())
    return {unit: _digest(paths) for unit, paths in files.items()}


def _reached(first: Iterable[Path], imported: Callable[[Path], set[Path]]) -> set[Path]:
    """Modules and all they import."""
    waiting = list(first)
    found = set(waiting)
    while waiting:
        for path in imported(waiting.pop()) - found:
            found.add(path)
            waiting.append(path)
    return found


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


def note_complete(work: str) -> None:
    """Remember that all code is in the cache that a kind of work needs: it was done."""
    _completion(work).touch()


def is_complete(work: str) -> bool:
    """Whether a kind of work was done with this state of the source: it compiles nothing any more."""
    return _completion(work).exists()


def _completion(work: str) -> Path:
    return unit_folder(os.environ[_VARIABLE], _ELSEWHERE) / f"{work}.complete"


def _inherited() -> CompiledCode | None:
    """The folder that the process which started this one uses."""
    folder = Path(os.environ.get(_VARIABLE, ""))
    is_ours = folder.name == _FOLDER and _LOCATORS in os.environ
    return CompiledCode(folder) if is_ours else None


def _first_usable() -> CompiledCode:
    """The folder in the user's own cache, else a temporary one."""
    chosen = os.environ.get(_VARIABLE)
    cache = Path(chosen) if chosen else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    wanted = cache / "observer_rt" / _FOLDER
    obstacle = _obstacle(wanted)
    if not obstacle:
        return CompiledCode(wanted)
    remedy = f"mend its rights or make room, or name another folder: {_VARIABLE}=FOLDER observer-rt ..."
    for root in _substitutes():
        if not (_foreign(root) or _obstacle(root / _FOLDER)):
            trouble = (
                f"compiled code cannot be kept in {wanted} ({obstacle}): it is in {root}, and after every start of "
                "the computer `run` is ready only when all is compiled anew, which takes a minute or two"
            )
            return CompiledCode(root / _FOLDER, trouble, remedy)
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


def _remove_unused(root: Path) -> None:
    for folder in root.iterdir():
        with contextlib.suppress(FileNotFoundError):  # another process may remove it at the same time
            if time.time() - folder.stat().st_mtime > _KEEP_UNUSED:
                shutil.rmtree(folder, ignore_errors=True)
