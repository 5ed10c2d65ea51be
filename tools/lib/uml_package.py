"""Downloads Debian's package of user-mode Linux by apt, needing no rights and changing nothing of the system."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from say import UnableError, say

PACKAGE = "user-mode-linux"
# Where the distribution does not carry the package (Ubuntu): a Debian archive as in sources.list, that is
# "URL suite component".
# Ubuntu carries Debian's keys, so that the chain of signatures stays whole.
ARCHIVE_VARIABLE = "VCAN_DEBIAN_ARCHIVE"
KEYRING_PACKAGE = "debian-archive-keyring"
KEYRING = "usr/share/keyrings/debian-archive-keyring.gpg"


def unpack_package(folder: Path) -> Path:
    """Download into `folder` and unpack there; the root of the unpacked files. Raises UnableError."""
    say(f"downloading Debian package {PACKAGE} (about 40 MB)")
    log = folder / "log"
    package = download_package(folder, log)
    if package is None:
        sys.stderr.write(log.read_text(errors="replace"))
        raise UnableError(
            f"cannot download {PACKAGE}, see above; where the distribution lacks it, name a Debian archive in "
            f"{ARCHIVE_VARIABLE} (URL suite component)",
            "sudo modprobe vcan",
        )
    return unpack(package, folder / "root")


def download_package(folder: Path, log: Path) -> Path | None:
    """The package from the system's lists, from fresh ones, or from the archive named; None if all fail."""
    system: list[str] = []
    if package := download(folder, log, PACKAGE, system):
        return package
    # A bare machine has no package lists yet, and only root may write the system's.
    fresh = with_lists(folder / "system", log, system)
    if package := download(folder, log, PACKAGE, fresh):
        return package
    archive = os.environ.get(ARCHIVE_VARIABLE)
    if archive is None:
        return None
    keyring = Path("/", KEYRING)
    if not keyring.exists():
        package = download(folder, log, KEYRING_PACKAGE, fresh)
        if package is None:
            return None
        keyring = unpack(package, folder / "keyring") / KEYRING
    sources = folder / "debian.list"
    sources.write_text(f"deb [signed-by={keyring}] {archive}\n")
    only_debian = [f"Dir::Etc::SourceList={sources}", "Dir::Etc::SourceParts=-"]
    return download(folder, log, PACKAGE, with_lists(folder / "debian", log, only_debian))


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
