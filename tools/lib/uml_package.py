"""Downloads Debian's package of user-mode Linux by apt, needing no rights and changing nothing of the system."""

from __future__ import annotations

import os
import platform
import subprocess
from pathlib import Path

from say import KernelError, say
from uml_kernel import bring_library

PACKAGE = "user-mode-linux"
LIBRARY_PACKAGE = "libc6"  # the newest kernel asks for a newer one than older systems have
# A Debian archive as in sources.list, that is "URL suite component", instead of a Debian system's own.
ARCHIVE_VARIABLE = "VCAN_DEBIAN_ARCHIVE"
NEWEST = "testing main"
ONLY_DEBIAN = ("Dir::Etc::SourceParts=-", "Dir::State::Status=/dev/null")  # what is installed is no alternative
KEYRING_PACKAGE = "debian-archive-keyring"  # Ubuntu carries Debian's keys: the chain of signatures stays whole.
KEYRING = "usr/share/keyrings/debian-archive-keyring.gpg"


def unpack_newest(folder: Path) -> Path:
    """Root of Debian testing's kernel with its C library, unpacked below `folder`; raises KernelError."""
    sources = archives()
    if not sources:
        # Said at once, for an older kernel may be found elsewhere, and boot.
        say(f'this system names no archive of Debian; {ARCHIVE_VARIABLE} takes one: "URL suite component"')
        mend = f'export {ARCHIVE_VARIABLE}="URL suite component"'
        raise KernelError(f"no archive to fetch Debian testing's {PACKAGE} from", mend)
    log = folder / "log"
    keyring = Path("/", KEYRING)
    if not keyring.exists():
        package = download_from_system(folder, log, KEYRING_PACKAGE)
        if package is None:
            mend = f"sudo apt-get update && sudo apt-get install -y {KEYRING_PACKAGE}"
            raise failure(log, f"no keys to check Debian's signatures with: {keyring} is missing", mend)
        keyring = unpack(package, folder / "keyring") / KEYRING
    for number, archive in enumerate(sources):
        own = folder / str(number)
        own.mkdir()
        source_list = own / "sources.list"
        source_list.write_text(f"deb [signed-by={keyring}] {archive}\n")
        options = with_lists(own, log, [f"Dir::Etc::SourceList={source_list}", *ONLY_DEBIAN])
        kernel, library = (download(own, log, name, options) for name in (PACKAGE, LIBRARY_PACKAGE))
        if kernel is not None and library is not None:
            unpack(kernel, own / "root")
            unpack(library, own / "root")
            bring_library(own / "root")
            return own / "root"
    raise failure(log, f"cannot download {PACKAGE} from {' nor '.join(sources)}, see above")


def unpack_distribution(folder: Path) -> Path:
    """Root of the kernel of the system's own archive, unpacked below `folder`; raises KernelError."""
    log = folder / "log"
    package = download_from_system(folder, log, PACKAGE)
    if package is None:
        raise failure(log, f"the system's own archive does not give {PACKAGE}, see above")
    return unpack(package, folder / "root")


def failure(log: Path, problem: str, mend: str = "sudo modprobe vcan") -> KernelError:
    """The error of a download, with what apt said."""
    return KernelError(problem, mend, log.read_text(errors="replace"))


def archives() -> list[str]:
    """Debian archives that may have the newest kernel, as in sources.list: the one named, or the system's mirrors."""
    if named := os.environ.get(ARCHIVE_VARIABLE):
        return [named]
    system = platform.freedesktop_os_release()
    if system["ID"] != "debian":
        return []
    wanted = ["Created-By: Packages", "Component: main", f"Release: {system.get('VERSION_CODENAME', '')}"]
    command = ["apt-get", "indextargets", "--format", "$(REPO_URI)", *wanted]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return [f"{uri} {NEWEST}" for uri in dict.fromkeys(uri.rstrip("/") for uri in done.stdout.split())]


def download_from_system(folder: Path, log: Path, name: str) -> Path | None:
    """The file of a package by the system's lists, or by fresh ones; None if both fail."""
    system: list[str] = []
    if package := download(folder, log, name, system):
        return package
    # A bare machine has no package lists yet, and only root may write the system's.
    return download(folder, log, name, with_lists(folder / "system", log, system))


def with_lists(folder: Path, log: Path, options: list[str]) -> list[str]:
    """Options of apt that keep its package lists in `folder`, into which they have been fetched."""
    (folder / "lists" / "partial").mkdir(parents=True)
    own = [*options, f"Dir::State::Lists={folder}/lists", f"Dir::Cache={folder}", "Debug::NoLocking=1"]
    apt(folder, log, own, "update")
    return own


def download(folder: Path, log: Path, name: str, options: list[str]) -> Path | None:
    """The file of Debian package `name`, downloaded into `folder`; None if apt cannot."""
    apt(folder, log, options, "download", name)
    return next(folder.glob(f"{name}_*.deb"), None)


def apt(folder: Path, log: Path, options: list[str], *arguments: str) -> None:
    """Run apt-get in `folder`; what it says goes to `log`, what it does is seen by its files."""
    # apt's download user cannot write a private folder; the invoking user can.
    settings = ["APT::Sandbox::User=root", *options]
    command = ["apt-get", "-qq", *(word for setting in settings for word in ("-o", setting)), *arguments]
    with log.open("ab") as sink:
        subprocess.run(command, cwd=folder, stdin=subprocess.DEVNULL, stdout=sink, stderr=sink, check=False)


def unpack(package: Path, root: Path) -> Path:
    """Unpack a package file below `root`, which is returned."""
    subprocess.run(["dpkg-deb", "-x", package, root], check=True)
    return root
