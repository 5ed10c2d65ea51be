"""Pieces of a self-contained HTML page: no script, nothing loaded from elsewhere."""

from collections.abc import Sequence
from html import escape

from observer_rt.config.bench import PACKAGE_DATA

STYLE_SHEET = PACKAGE_DATA / "report.css"


def document(title: str, body: str) -> str:
    """A whole page."""
    style = STYLE_SHEET.read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def section(heading: str, *parts: str) -> str:
    """A section with its heading; nothing at all when it has no content."""
    content = "\n".join(part for part in parts if part)
    return f"<section>\n<h2>{escape(heading)}</h2>\n{content}\n</section>" if content else ""


def paragraph(text: str, style: str = "") -> str:
    """A paragraph of HTML."""
    chosen = f' class="{style}"' if style else ""
    return f"<p{chosen}>{text}</p>"


def table(
    headings: Sequence[str],
    rows: Sequence[Sequence[str]],
    numbers: Sequence[int] = (),
    chosen: int | None = None,
) -> str:
    """A table of HTML cells; numbers: columns set to the right; chosen: a row that stands out."""

    def cells(tag: str, row: Sequence[str]) -> str:
        return "".join(
            f'<{tag} class="number">{cell}</{tag}>' if column in numbers else f"<{tag}>{cell}</{tag}>"
            for column, cell in enumerate(row)
        )

    lines = [f"<tr>{cells('th', headings)}</tr>"]
    for number, row in enumerate(rows):
        style = ' class="chosen"' if number == chosen else ""
        lines.append(f"<tr{style}>{cells('td', row)}</tr>")
    return '<div class="scroll"><table>\n' + "\n".join(lines) + "\n</table></div>"


def figure(svg: str, caption: str) -> str:
    """A drawing with what it shows."""
    return f"<figure>\n{svg}\n<figcaption>{caption}</figcaption>\n</figure>"


def code(text: str) -> str:
    """A name of file, effect or parameter."""
    return f"<code>{escape(text)}</code>"


def callout(text: str, style: str = "") -> str:
    """A remark that stands out; style: good or bad."""
    return f'<div class="callout {style}">{text}</div>'
