"""What makes a user-mode Linux kernel that can be booted: the program, its modules, its C library."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

# In the order they must be loaded; bcm and vxcan are what candump's relatives and gateway tests ask for.
MODULES = ("can", "can-raw", "can-bcm", "can-dev", "vcan", "vxcan")
OPTIONAL_MODULES = ("sch_tbf",)  # slows an interface down, for tests of full queues; may be built in
PROGRAM = "usr/bin/linux.uml"
LIBRARIES = "libraries"  # below the root of a kernel that brings its own C library
LOADER = "ld-linux-x86-64.so.2"  # user-mode Linux is built for this architecture only


@dataclass(frozen=True)
class Kernel:
    """A bootable user-mode Linux: the program, its modules in loading order, the C library it brings if any."""

    program: Path
    modules: tuple[Path, ...]
    libraries: Path | None


def kernel_below(root: Path) -> Kernel | None:
    """The kernel below `root`, if all its parts are there; modules are searched by name, for their folders differ."""
    program, libraries = root / PROGRAM, root / LIBRARIES
    if not os.access(program, os.X_OK):
        return None
    for modules in (root / "usr/lib/uml/modules", root / "lib/uml/modules"):
        for version in sorted(modules.glob("*"), reverse=True):
            files = {path.name.split(".")[0]: path for path in version.rglob("*.ko*")}
            if all(name in files for name in MODULES):
                present = tuple(files[name] for name in (*MODULES, *OPTIONAL_MODULES) if name in files)
                return Kernel(program, present, libraries if libraries.is_dir() else None)
    return None


def bring_library(root: Path) -> None:
    """Make the program below `root` use the C library below `root`, whatever the system's is.

    It then asks for the loader by a name without folder: it must be started in the folder `LIBRARIES`.
    """
    folder = next(path.parent for path in root.rglob(LOADER) if path.parent.name == "x86_64-linux-gnu")
    (root / LIBRARIES).symlink_to(folder.relative_to(root))
    asked = b"/lib64/" + LOADER.encode() + b"\0"
    image = (root / PROGRAM).read_bytes()
    (root / PROGRAM).write_bytes(image.replace(asked, asked[len(b"/lib64/") :].ljust(len(asked), b"\0"), 1))
