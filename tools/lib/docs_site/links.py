"""Looks at every link of a built site: `python -m docs_site.links FOLDER`. Those to other hosts are not followed."""

import sys
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADED = ("script", "link", "img", "iframe", "source")  # what a browser fetches without being asked


class Document(HTMLParser):
    """A page: its anchors, and the targets that its tags name."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors = {""}
        self.targets: list[tuple[str, str]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag is called, and what it leads to."""
        for name, value in attrs:
            if name in ("id", "name"):
                self.anchors.add(value or "")
            elif name in ("href", "src") and value is not None:
                self.targets.append((tag, value))


@cache
def document(path: Path) -> Document:
    """A page of the site."""
    return Document(path.read_text(encoding="utf-8"))


def objections(site: Path) -> Iterator[str]:
    """What is wrong with the links of a site, and what its pages would fetch from elsewhere."""
    for page in sorted(site.rglob("*.html")):
        if page.name == "404.html":  # its links begin at the root of a server
            continue
        for tag, target in document(page).targets:
            if problem := _problem(page, tag, target):
                yield f"{page.relative_to(site)}: {target}: {problem}"


def _problem(page: Path, tag: str, target: str) -> str:
    parts = urlsplit(target)
    if parts.scheme or parts.netloc:
        return "is fetched from elsewhere" if tag in LOADED and parts.scheme != "data" else ""
    path = page if not parts.path else (page.parent / unquote(parts.path)).resolve()
    if not path.is_file():
        return "there is no such file"
    is_page = path.suffix == ".html"
    return (
        "there is no such anchor" if is_page and unquote(parts.fragment) not in document(path).anchors else ""
    )


if __name__ == "__main__":
    found = list(objections(Path(sys.argv[1]).resolve()))
    print("\n".join(found) or f"{sys.argv[1]}/index.html: every link leads somewhere")
    sys.exit(bool(found))
