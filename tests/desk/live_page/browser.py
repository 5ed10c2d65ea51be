"""A real browser without a screen, and a program that serves a page to it."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from playwright.sync_api import Browser, Error, Playwright

from observer_rt.foundation.errors import UserError

_OBTAIN = f"{sys.executable} -m playwright install --with-deps chromium-headless-shell"
_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_QUIET = (  # nothing of its own goes out
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
_URL = re.compile(r"http://\S+:\d+/\S*")


def launch(playwright: Playwright) -> Browser:
    """The first that starts (Ubuntu's `chromium-browser` only asks for a snap). Raises UserError if none does."""
    alone: dict[str, str | float | bool] = {**os.environ}
    alone.pop("LD_PRELOAD", None)  # sanitizers
    failures = []
    for path in (*filter(None, map(shutil.which, _BROWSERS)), None):
        try:
            return playwright.chromium.launch(executable_path=path, args=list(_QUIET), env=alone)
        except Error as error:
            failures.append(f"{path or 'of Playwright'}: {error}")
    raise UserError("Chromium", "cannot be started: " + "\n".join(failures), _OBTAIN)


@dataclass(frozen=True)
class PageServer:
    process: subprocess.Popen[str]
    url: str


@contextmanager
def served(command: Sequence[str | Path], folder: Path | None = None) -> Iterator[PageServer]:
    """Start a program that tells its address on stderr; end it with SIGTERM. Raises UserError where it tells none."""
    words = list(map(str, command))
    with subprocess.Popen(words, cwd=folder, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            lines = []
            for line in process.stderr:
                lines.append(line)
                if (result := _URL.search(line)) is not None:
                    yield PageServer(process, result[0])
                    break
            else:
                raise UserError(" ".join(words), "served no page:\n" + "".join(lines), "see what it says")
        finally:
            process.terminate()
