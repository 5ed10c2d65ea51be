"""Which user-mode Linux tools/vcan takes: one that boots on this machine, and none is tried twice."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

LIB = Path(__file__).parents[2] / "tools" / "lib"
OBTAIN = """
import os, platform, sys
from pathlib import Path
platform.freedesktop_os_release = lambda: {"ID": os.environ["SYSTEM"]}
sys.path.insert(0, sys.argv[1])
from say import UnableError
from uml_choice import obtain_kernel
try:
    print(obtain_kernel(Path(sys.argv[2])).program)
except UnableError as error:
    sys.exit(f"{error.details}{error} MEND {error.mend}")
"""
# What kernels before 6.13 end with on a CPU with AMX.
PANICS = 'echo "ptrace set fp regs failed, errno = 14"; echo "Kernel panic - not syncing"; exit 134'
# The command's exit code goes to the last descriptor of the third serial line.
BOOTS = "for word; do case $word in ssl2=*) answer=${word##*fd:};; esac; done; echo 0 >/proc/self/fd/$answer"
# As apt-get and dpkg-deb -x would: "packages" are folders.
APT = """
case " $* " in *" indextargets "*) echo $MIRRORS; exit;; esac
for last; do :; done
[ -d "$SHELF/$last" ] && cp -r "$SHELF/$last" "${last}_1.deb"
exit 0
"""
DPKG = 'mkdir -p "$3"; cp -r "$2"/. "$3"'
MODULES = ("can", "can-raw", "can-bcm", "can-dev", "vcan", "vxcan")


def write_program(path: Path, script: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


def write_kernel(root: Path, script: str) -> Path:
    """A kernel below `root` that notes every boot in the file `boots` beside its program."""
    program = root / "usr/bin/linux.uml"
    write_program(program, f'echo boot >>"$(dirname "$0")/boots"\n{script}')
    for name in MODULES:
        module = root / f"usr/lib/uml/modules/1/{name}.ko"
        module.parent.mkdir(parents=True, exist_ok=True)
        module.touch()
    return program


class Machine:
    """A machine of its own: its cache, its installed system, and what its archives have."""

    def __init__(self, folder: Path) -> None:
        self.cache = folder / "cache/observer_rt_tools/user-mode-linux"
        self.system = folder / "system"
        self.shelf = folder / "shelf"
        self._programs = folder / "programs"
        self._folder = folder
        self.shelf.mkdir()
        write_program(self._programs / "apt-get", APT)
        write_program(self._programs / "dpkg-deb", DPKG)

    def offer(self, script: str) -> None:
        """Put a kernel into the archives, and the C library."""
        write_kernel(self.shelf / "user-mode-linux", script)
        loader = self.shelf / "libc6/usr/lib/x86_64-linux-gnu/ld-linux-x86-64.so.2"
        loader.parent.mkdir(parents=True)
        loader.touch()
        (self.shelf / "debian-archive-keyring").mkdir()

    def obtain(self) -> tuple[str, str]:
        """The kernel chosen, and what was said."""
        of_machine = {
            "XDG_CACHE_HOME": str(self._folder / "cache"),
            "PATH": f"{self._programs}:{os.environ['PATH']}",
            "SHELF": str(self.shelf),
            "SYSTEM": "debian",
            "MIRRORS": "http://mirror.invalid/debian/",
            "VCAN_DEBIAN_ARCHIVE": "",
        }
        command = [sys.executable, "-c", OBTAIN, str(LIB), str(self.system)]
        done = subprocess.run(command, env=os.environ | of_machine, capture_output=True, text=True, timeout=60)
        return done.stdout.strip(), done.stderr


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


def boots_of(program: Path) -> int:
    notes = program.parent / "boots"
    return len(notes.read_text().splitlines()) if notes.exists() else 0


def test_kernel_that_boots_is_tried_once(machine: Machine) -> None:
    program = write_kernel(machine.system, BOOTS)
    for _ in range(2):
        assert machine.obtain()[0] == str(program)
    assert boots_of(program) == 1


def test_where_the_installed_one_panics_another_is_fetched(machine: Machine) -> None:
    """The first is remembered, as is the one that boots."""
    program = write_kernel(machine.system, PANICS)
    machine.offer(BOOTS)
    chosen, said = machine.obtain()
    assert chosen == str(machine.cache / "newest/usr/bin/linux.uml")
    assert f"{program} does not boot on this machine" in said
    again, said = machine.obtain()
    assert again == chosen
    assert said == ""
    assert boots_of(program) == boots_of(Path(chosen)) == 1


def test_none_boots(machine: Machine) -> None:
    """Each is named with the reason, and how to try anew."""
    installed = write_kernel(machine.system, PANICS)
    machine.offer(PANICS)
    for _ in range(2):
        chosen, said = machine.obtain()
        assert chosen == ""
        for program in (installed, *(machine.cache / n / "usr/bin/linux.uml" for n in ("newest", "distribution"))):
            assert f"{program}: ptrace set fp regs failed, errno = 14" in said
            assert boots_of(program) == 1
        assert f"MEND rm {machine.cache}" in said
    trials = list((machine.cache / "trials").iterdir())
    assert len(trials) == 3
