"""Builds the compiled core, observer_rt/core, by meson and ninja, and puts its modules beside their sources."""

import fcntl
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
CORE = REPOSITORY / "observer_rt" / "core"
STUBS = REPOSITORY / "tools" / "lib" / "core_stubs.py"  # writes what type checkers read of a module
BUILD = REPOSITORY / "build"
STATE = BUILD / "core-state"  # which sources, of which build, the modules beside them were made of
SPLIT_HEADERS = BUILD / "split-headers"
UNPACKED_HEADERS = BUILD / "python-headers" / "usr" / "include"
SUFFIX = ".abi3.so"
STUB = ".pyi"
ZIG = f"{sys.executable} -m ziglang cc"
CHECKED_VARIABLE = "OBSERVER_RT_CHECKED_CORE"  # set: the build with bounds checks and sanitizers


class CoreBuildError(Exception):
    """The compiled core cannot be built; the text says why and what mends it."""


@dataclass(frozen=True)
class Kind:
    """How the core is compiled, in a folder of its own."""

    folder: str
    machine: tuple[str, ...] = ()
    """Flags of the compiler that choose the processor."""
    checked: bool = False
    """With bounds checks, address and undefined behaviour sanitizers."""
    target: str = ""
    """Another machine, or an older C library than this one's, as `zig cc -target` names it: x86_64-linux-gnu.2.17."""


HERE = Kind("core", ("-march=native",))
CHECKED = Kind("core-checked", checked=True)


def rebuild_if_edited() -> None:
    """Build anew when a source has changed since the modules were put beside them."""
    if not _is_current(_sources_state()):
        build_in_place()


def build_in_place() -> None:
    """Build all modules, and put them beside their sources; several processes at once take turns.

    Raises:
        CoreBuildError: without Cython, meson, ninja, a C compiler or Python's headers, or when compiling fails.
    """
    BUILD.mkdir(exist_ok=True)
    with (BUILD / "core-lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if _is_current(_sources_state()):  # another process was first
            return
        modules = build(_kind())
        for name, built in modules.items():  # by rename: processes that run keep the module that they have loaded
            if not (target := CORE / name).exists() or target.stat().st_mtime_ns != built.stat().st_mtime_ns:
                shutil.copy2(built, temporary := target.with_suffix(".new"))
                temporary.replace(target)
        for ending in (SUFFIX, STUB):
            for orphan in set(CORE.rglob(f"*{ending}")) - {CORE / name for name in modules}:
                orphan.unlink()
        STATE.write_text(_sources_state())


def build(kind: Kind) -> dict[str, Path]:
    """The file that was built for each path in the core; errors as of `build_in_place`."""
    print("observer-rt: compiling the core; half a minute on two idle cores", file=sys.stderr, flush=True)
    names = _module_names()
    folder = BUILD / kind.folder
    _configure(folder, kind)
    targets = {name + SUFFIX: name.replace("/", ".") + SUFFIX for name in names}
    _run(["ninja", "-C", str(folder), *targets.values()], kind)
    for needs in folder.rglob("*.pyx.c.dep"):  # where pip builds, Cython's own files are in a passing folder
        needs.write_text(re.sub(r"\S*Cython/Includes/\S+", "", needs.read_text()))
    stubs = {name: name.replace("/", ".") + STUB for name in names if name != "views"}
    paths = [str(path) for name, stub in stubs.items() for path in (f"{CORE / name}.pyx", folder / stub)]
    _run([sys.executable, str(STUBS), *paths], kind)
    targets |= {name + STUB: stub for name, stub in stubs.items()}
    return {name: folder / target for name, target in targets.items()}


def compiler() -> str:
    """The C compiler's command, as `$CC` or as found, else that of ziglang."""
    named = os.environ.get("CC")
    return named or next((name for name in ("cc", "gcc", "clang") if shutil.which(name)), ZIG)


def _kind() -> Kind:
    return CHECKED if CHECKED_VARIABLE in os.environ else HERE


def _is_current(state: str) -> bool:
    return STATE.is_file() and STATE.read_text() == state


def _sources_state() -> str:
    """What the modules beside the sources are made of: a line a file, each module among them."""
    times = [f"{path} {path.stat().st_mtime_ns}" for path in _sources()]
    existing = [file for name in _module_names() for file in (name + SUFFIX, name + STUB) if (CORE / file).exists()]
    return "\n".join([_kind().folder, *times, *existing])


def _sources() -> list[Path]:
    endings = ("*.pyx", "*.pxd", "*.pxi", "meson.build")
    return sorted([STUBS, *(path for ending in endings for path in CORE.rglob(ending))])


def _module_names() -> list[str]:
    sources = (path for path in _sources() if path.suffix == ".pyx")
    return ["views", *(path.relative_to(CORE).with_suffix("").as_posix() for path in sources)]


def _configure(folder: Path, kind: Kind) -> None:
    modules = [name for name in _module_names() if name != "views"]
    options = [
        f"-Dmodules={','.join(modules)}",
        f"-Dpython_headers={','.join(str(folder) for folder in _headers())}",
        f"-Dmachine={','.join(kind.machine)}",
        f"-Dchecked={'true' if kind.checked else 'false'}",
    ]
    tools = folder.with_suffix(".tools")
    tools.parent.mkdir(exist_ok=True)
    tools.write_text(_machine_file(kind))
    asked = folder / "asked-for"
    edited = str((CORE / "meson.build").stat().st_mtime_ns)
    tools_used = [sys.executable, *(package.version for package in distributions(name="cython"))]
    # ninja calls meson by its path, which is that of a passing environment where pip has built
    wanted = "\n".join([*options, compiler(), kind.target, edited, _program("meson"), *tools_used])
    if asked.is_file() and asked.read_text() == wanted:
        return
    if asked.is_file() and not asked.read_text().endswith(("\n".join(["", *tools_used]), f"\n{sys.executable}")):
        shutil.rmtree(folder)  # meson keeps the Python it began with, which may be gone; modules share code of Cython
    files = "--cross-file" if kind.target else "--native-file"
    setup = ["meson", "setup", files, str(tools), *options, str(folder), str(CORE)]
    try:
        _run([*setup, "--reconfigure"] if asked.is_file() else setup, kind)
    except CoreBuildError:  # as where an option has become another: begin anew
        if not asked.is_file():
            raise
        shutil.rmtree(folder)
        _run(setup, kind)
    asked.write_text(wanted)


def _machine_file(kind: Kind) -> str:
    # By this Python, not by where the command is: that is a passing folder where pip builds apart.
    lines = ["[binaries]", f"cython = ['{sys.executable}', '-m', 'cython']"]
    if kind.target:
        processor = kind.target.partition("-")[0]
        command = [sys.executable, "-m", "ziglang", "cc", "-target", kind.target, *_split_headers(processor)]
        lines += [
            f"c = {command}",
            *("[host_machine]", "system = 'linux'", f"cpu_family = '{processor}'", f"cpu = '{processor}'"),
            *("endian = 'little'", "[properties]", "needs_exe_wrapper = true"),
        ]
    return "\n".join(lines) + "\n"


def _headers() -> list[Path]:
    """Folders to look for headers in: this Python's, or where tools/lib/venv.sh has unpacked them."""
    own = Path(sysconfig.get_path("include"))
    if (own / "Python.h").is_file():
        return [own]
    unpacked = UNPACKED_HEADERS / f"python{sys.version_info.major}.{sys.version_info.minor}"
    if (unpacked / "Python.h").is_file():
        return [unpacked, UNPACKED_HEADERS]
    raise CoreBuildError(
        f"Python's headers are missing: no Python.h in {own}. On Debian and Ubuntu: sudo apt-get install python3-dev"
    )


def _split_headers(processor: str) -> list[str]:
    """Options for the part of Python's headers that Debian keeps by processor, where ziglang does not look.

    Of the machine that builds: those of two processors of 64 bits are alike in what the stable interface needs.
    """
    own = Path(sysconfig.get_path("include"))
    part = own.parent / str(sysconfig.get_config_var("MULTIARCH")) / own.name
    if not part.is_dir():
        return []
    link = SPLIT_HEADERS / f"{processor}-linux-gnu" / own.name
    link.parent.mkdir(parents=True, exist_ok=True)
    link.unlink(missing_ok=True)
    link.symlink_to(part)
    return [f"-I{SPLIT_HEADERS}"]


def _path() -> str:
    return os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])


def _program(name: str) -> str:
    """Path of a program of the build."""
    program = shutil.which(name, path=_path())
    if program is None:
        raise CoreBuildError(
            f"the compiled core is older than its sources, and {name} is missing, which builds it: "
            f"pip install -e '{REPOSITORY}' builds it apart, pip install -e '{REPOSITORY}[dev]' brings what does"
        )
    return program


def _run(command: list[str], kind: Kind) -> None:
    environment = os.environ | {"PATH": _path()}
    environment.pop("LD_PRELOAD", None)  # what the tests of the checked build run with
    if not kind.target:  # else the machine file names it; the machine itself is asked for nothing
        environment["CC"] = compiler()
    command = [_program(command[0]), *command[1:]]
    ran = subprocess.run(command, env=environment, capture_output=True, text=True)
    if ran.returncode:
        raise CoreBuildError(f"the compiled core cannot be built:\n{(ran.stdout + ran.stderr)[-4000:]}")


if __name__ == "__main__":
    try:
        build_in_place()
    except CoreBuildError as error:
        sys.exit(str(error))
