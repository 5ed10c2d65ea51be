"""Finds Debian's user-mode Linux kernel: the installed package, or one unpacked into a per-user cache."""

from __future__ import annotations

import fcntl
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from say import UnableError, say
from uml_package import PACKAGE, unpack_package

# In the order they must be loaded; bcm and vxcan are what candump's relatives and gateway tests ask for.
MODULES = ("can", "can-raw", "can-bcm", "can-dev", "vcan", "vxcan")
OPTIONAL_MODULES = ("sch_tbf",)  # slows an interface down, for tests of full queues; may be built in


@dataclass(frozen=True)
class Kernel:
    """A bootable user-mode Linux: the program and its modules in loading order."""

    program: Path
    modules: tuple[Path, ...]


def cache_folder() -> Path:
    """Where the package is unpacked when it is not installed."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "observer_rt_tools" / PACKAGE


def kernel_below(root: Path) -> Kernel | None:
    """The kernel installed below `root`, if all its parts are there.

    Versions differ in where below the modules folder a module lies: they are searched by name.
    """
    program = root / "usr/bin/linux.uml"
    if not os.access(program, os.X_OK):
        return None
    for modules in (root / "usr/lib/uml/modules", root / "lib/uml/modules"):
        for version in sorted(modules.glob("*"), reverse=True):
            found = {path.name.split(".")[0]: path for path in version.rglob("*.ko*")}
            if all(name in found for name in MODULES):
                there = (name for name in (*MODULES, *OPTIONAL_MODULES) if name in found)
                return Kernel(program, tuple(found[name] for name in there))
    return None


def present_kernel() -> Kernel | None:
    """The installed kernel, else the cached one, else None."""
    return kernel_below(Path("/")) or kernel_below(cache_folder())


def obtain_kernel() -> Kernel:
    """The kernel, downloaded and unpacked first if need be; several callers at once fetch it once."""
    kernel = present_kernel()
    if kernel is not None:
        return kernel
    if shutil.which("apt-get") is None or shutil.which("dpkg-deb") is None:
        raise UnableError(
            "user-mode Linux comes as a Debian package, and this machine has no apt-get", "sudo modprobe vcan"
        )
    cache = cache_folder()
    cache.parent.mkdir(parents=True, exist_ok=True)
    with (cache.parent / f"{PACKAGE}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if kernel_below(cache) is None:
            fetch_into(cache)
    kernel = kernel_below(cache)
    if kernel is None:
        raise UnableError(f"the package {PACKAGE} lacks linux.uml or its CAN modules", "sudo modprobe vcan")
    return kernel


def fetch_into(cache: Path) -> None:
    """Download the package and unpack it into `cache`; the lock must be held."""
    folder = cache.with_suffix(".partial")
    shutil.rmtree(folder, ignore_errors=True)  # left by a download that was killed
    folder.mkdir()
    try:
        root = unpack_package(folder)
        shutil.rmtree(cache, ignore_errors=True)
        root.rename(cache)
        say(f"unpacked into {cache}")
    finally:
        shutil.rmtree(folder, ignore_errors=True)
