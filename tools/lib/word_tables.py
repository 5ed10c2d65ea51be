"""Writes words and output signals into docs/operating.md and the databases: see `tools/words`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from observer_rt.bus.mapping.output_signals import RESULTS, OutputSignal, StatusValues, rows_of, signals_of
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.words import COUNTERS, REASONS, STATES, TOPICS, named

NO_VALUE = "not available"
MESSAGES: Mapping[int, Any] = {result.number: result.values for result in RESULTS.values()}
BY_HAND = ("CRC", "Counter", "Page")  # signals of every frame, which carry no value
ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/operating.md"
DATABASES = tuple(ROOT / "dbc" / name for name in ("observer_fd.dbc", "observer_classic.dbc"))


def page_with_words(text: str) -> str:
    """The page, its tables below these headings anew."""
    signals = dict(zip(StatusValues._fields, signals_of(StatusValues), strict=True))
    tables: dict[str, Iterable[tuple[str, ...]]] = {
        "States": ((s.name, w.what, w.remedy) for s, w in STATES.items()),
        "Reasons": ((r.name, w.what, w.remedy) for r, w in REASONS.items()),
        "Counters": ((signals[name], w.what, w.remedy) for name, w in COUNTERS.items()),
        "The log": ((str(t), w.what, w.remedy) for t, w in TOPICS.items()),
    }
    for heading, rows in tables.items():
        lines = "".join(f"| `{name}` | {' | '.join(cells)} |\n" for name, *cells in rows)
        below = rf"(\n## {heading}\n(?:(?!\n## ).)*?\n\|-[-|]*\n)(?:\|[^\n]*\n)*"
        match = re.search(below, text, re.DOTALL)
        if match is None:
            raise ValueError(f"no table below the heading {heading!r}")
        text = text[: match.start()] + match[1] + lines + text[match.end() :]
    return text


def database_with_signals(text: str, messages: Mapping[int, Any] = MESSAGES) -> str:
    """The database, the output signals of its messages anew; the order of comments and attributes is kept."""
    for number, values in messages.items():
        block = re.search(rf"^BO_ {number} .*\n((?: SG_ .*\n)+)", text, re.MULTILINE)
        if block is None:
            raise ValueError(f"no message {number}")
        is_paged = " SG_ Page M " in block[1]
        rows = {
            name: row
            for name, row in zip(signals_of(values), rows_of(values).values(), strict=True)
            if (row.classic if is_paged else row.fd) is not None
        }
        by_hand = [line for line in block[1].splitlines(True) if line.split()[1] in BY_HAND]
        written = "".join(by_hand + [line for _, line in sorted(_placed(rows, is_paged))])
        last = max(row.page or 0 for row in rows.values())
        written = re.sub(r"(?<= SG_ Page M )(.*)\[0\|\d+\]", rf"\1[0|{last}]", written)
        text = text[: block.start(1)] + written + text[block.end(1) :]
        says = {name: f'"{row.says}"' for name, row in rows.items() if row.says}
        missing = {name: str(_top(row)) for name, row in rows.items() if row.quantity is not None}
        error = {name: str(_top(row) - 1) for name, row in rows.items() if row.quantity and row.quantity.has_error}
        for kind, said in (("CM_", says), ('BA_ "GenSigSNA"', missing), ('BA_ "GenSigError"', error)):
            text = _with_lines(text, f"{kind} SG_ {number}", said)
    return text


def _placed(rows: Mapping[str, OutputSignal], is_paged: bool) -> Iterator[tuple[tuple[int, int], str]]:
    """Page (-1: in every frame) and first bit of each signal, and its line."""
    for name, row in rows.items():
        page, start = (row.page, row.classic) if is_paged else (None, row.fd)
        scale, offset, unit, highest = 1.0, 0.0, "", _top(row)
        if row.quantity is not None:
            scale, offset, unit = row.quantity[:3]
            highest -= 2
        among = "" if page is None else f" m{page}"
        limits = f"({scale:g},{offset:g}) [{offset:g}|{offset + scale * highest:.10g}]"
        line = f' SG_ {name}{among} : {start}|{row.bits}@1+ {limits} "{unit}" BenchComputer\n'
        yield (-1 if page is None else page, start or 0), line


def _top(row: OutputSignal) -> int:
    """The largest code."""
    return int((1 << row.bits) - 1)


def _with_lines(text: str, kind: str, said: Mapping[str, str]) -> str:
    """What a kind of line says of signals: lines stay where they are, new ones come behind, others go."""
    left = dict(said)
    lines = re.compile(rf"^{kind} (\w+) .*\n", re.MULTILINE)

    def line(match: re.Match[str]) -> str:
        if match[1] in BY_HAND:
            return match[0]
        return f"{kind} {match[1]} {left.pop(match[1])};\n" if match[1] in left else ""

    text = lines.sub(line, text)
    end = max((match.end() for match in lines.finditer(text)), default=len(text))
    return text[:end] + "".join(f"{kind} {name} {words};\n" for name, words in left.items()) + text[end:]


def database_with_words(text: str) -> str:
    """The database, its output signals and value tables anew: those of states, reasons, and codes for no value."""
    text = database_with_signals(text)
    text = re.sub(rf'^VAL_ \d+ \w+ \d+ "{NO_VALUE}" ;\n', "", text, flags=re.MULTILINE)
    coded = re.findall(r'^BA_ "GenSigSNA" SG_ (\d+ \w+) (\d+);$', text, flags=re.MULTILINE)
    text = text.rstrip("\n") + "\n" + "".join(f'VAL_ {signal} {code} "{NO_VALUE}" ;\n' for signal, code in coded)
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
