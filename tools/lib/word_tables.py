"""Writes the words of `observer_rt/engine/words.py` into docs/operating.md and the value tables of the databases."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable
from pathlib import Path

from observer_rt.bus.mapping.output_messages import StatusValues, signals_of
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.words import COUNTERS, REASONS, STATES, TOPICS, named

NO_VALUE = "not available"
ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/operating.md"
DATABASES = tuple(ROOT / "dbc" / name for name in ("observer_fd.dbc", "observer_classic.dbc"))


def page_with_words(text: str) -> str:
    """The page, its tables below these headings anew."""
    signals = dict(zip(StatusValues._fields, signals_of(StatusValues), strict=True))
    tables: dict[str, Iterable[tuple[str, ...]]] = {
        "States": ((s.name, w.what, w.remedy) for s, w in STATES.items()),
        "Reasons": ((r.name, str(int(r)), w.what, w.remedy) for r, w in REASONS.items()),
        "Counters": ((signals[name], w.what, w.remedy) for name, w in COUNTERS.items()),
        "The log": ((str(t), logging.getLevelName(w.level), w.what, w.remedy) for t, w in TOPICS.items()),
    }
    for heading, rows in tables.items():
        lines = "".join(f"| `{name}` | {' | '.join(cells)} |\n" for name, *cells in rows)
        below = rf"(\n## {heading}\n(?:(?!\n## ).)*?\n\|-[-|]*\n)(?:\|[^\n]*\n)*"
        found = re.search(below, text, re.DOTALL)
        if found is None:
            raise ValueError(f"no table below the heading {heading!r}")
        text = text[: found.start()] + found[1] + lines + text[found.end() :]
    return text


def database_with_words(text: str) -> str:
    """The database, the value tables anew: of `State`, of `Reason`, and of every signal with a code for no value."""
    text = re.sub(rf'^VAL_ \d+ \w+ \d+ "{NO_VALUE}" ;\n', "", text, flags=re.MULTILINE)
    coded = re.findall(r'^BA_ "GenSigSNA" SG_ (\d+ \w+) (\d+);$', text, flags=re.MULTILINE)
    text = (
        text.rstrip("\n") + "\n" + "".join(f'VAL_ {signal} {code} "{NO_VALUE}" ;\n' for signal, code in coded)
    )
    for name, members in (("State", State), ("Reason", Reason)):
        values = " ".join(f'{int(member)} "{named(member)}"' for member in members)
        text = re.sub(rf"^(VAL_ \d+ {name}) .*;$", rf"\1 {values} ;", text, flags=re.MULTILINE)
    return text


def main() -> None:
    """Write the files that are not up to date."""
    for path in (PAGE, *DATABASES):
        before = path.read_text("utf-8")
        after = page_with_words(before) if path == PAGE else database_with_words(before)
        if after != before:
            path.write_text(after, "utf-8")
            print(f"written: {path.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
