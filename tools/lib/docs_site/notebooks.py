"""Notebooks as pages of the site: text, programs, and what these showed when the notebook was kept."""

import base64
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

_STYLE = re.compile(r"<style.*?</style>\n?|(?<=<table)[^>]*", re.DOTALL)  # of a table: the site has its own
_TOP = "*Made of [{name}]({name}), to be run in Jupyter.*\n"


class NotebookPage(NamedTuple):
    """A page in Markdown, and its pictures by the names of their files, which lie beside it."""

    markdown: str
    pictures: Mapping[str, bytes]


def notebook_page(path: Path) -> NotebookPage:
    """The page of a notebook; its heading stays the first line."""
    pictures: dict[str, bytes] = {}
    parts: list[str] = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(f"{source}\n")
        else:
            parts.append(f"```python\n{source}\n```\n")
            parts += _shown(cell["outputs"], path.stem, pictures)
    heading, *others = parts
    first, _, rest = heading.partition("\n")
    return NotebookPage("\n".join([f"{first}\n", _TOP.format(name=path.name), rest, *others]), pictures)


def _shown(outputs: list[dict[str, Any]], stem: str, pictures: dict[str, bytes]) -> Iterator[str]:
    """Outputs of a cell as Markdown; a picture becomes a file."""
    for output in outputs:
        forms = output.get("data", {})
        if "image/png" in forms:
            name = f"{stem}_{len(pictures) + 1}.png"
            pictures[name] = base64.b64decode("".join(forms["image/png"]))
            yield f"![What the program draws]({name})\n"
        elif "text/html" in forms:
            yield _STYLE.sub("", "".join(forms["text/html"])) + "\n"
        else:
            yield f"```text\n{''.join(output.get('text') or forms['text/plain']).rstrip()}\n```\n"
