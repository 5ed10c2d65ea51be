"""The pages of README and docs as tests read them: commands, what they are said to print, files and programs."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
_BLOCK = re.compile(r"^```(?P<language>\w*)\n(?P<fenced>(?s:.*?))^```$|(?P<indented>(?:^    .*\n)+)", re.MULTILINE)
_PROGRAM = re.compile(r"^(?:\$ )?((?:observer-rt|tools/\w+|sudo|source|journalctl|sqlite3|podman|pip|python3?)\b.*)$")
_CELL = re.compile(r"^\|.*\|$", re.MULTILINE)
_IN_CELL = re.compile(r"`(observer-rt \w+ [^`]*\.\w+[^`]*)`")


class Page:
    def __init__(self, path: str) -> None:
        self.path = path
        self.text = (ROOT / path).read_text(encoding="utf-8")

    @property
    def commands(self) -> list[str]:
        """Command lines of blocks, and of code in tables, each once, in order, without comments and `$`."""
        lines: list[str] = []
        for match in sorted([*_BLOCK.finditer(self.text), *_CELL.finditer(self.text)], key=re.Match.start):
            lines += _IN_CELL.findall(match[0]) if match.re is _CELL else _in_block(match)
        return list(dict.fromkeys(lines))

    def shown(self, command: str) -> list[str]:
        """The lines that stand below `$ command`, as they are."""
        _, heading, after = self.text.partition(f"    $ {command}\n")
        assert heading, command
        shown = re.match(r"(?:    .*\n)*", after)
        assert shown is not None
        return shown[0].splitlines()

    def fenced(self, language: str) -> list[str]:
        return [match["fenced"] for match in _BLOCK.finditer(self.text) if match["language"] == language]

    def indented(self) -> Iterator[str]:
        """Blocks that are indented, without their indent."""
        for match in _BLOCK.finditer(self.text):
            if match["indented"]:
                yield re.sub(r"^    ", "", match["indented"], flags=re.MULTILINE)


PAGES = [Page("README.md"), *(Page(f"docs/{path.name}") for path in sorted((ROOT / "docs").glob("*.md")))]


def needs_bus(command: str) -> bool:
    return bool(re.match(r"observer-rt (run|record|replay)\b(?!.*--print-|.*--interface virtual)", command))


def serves_a_page(command: str) -> bool:
    """Whether a command line waits for browsers until it is interrupted; test_page.py of the live page has one."""
    return command.startswith("observer-rt monitor ")


def words_of(command: str) -> tuple[list[str], Path | None]:
    """Arguments of an `observer-rt` command line, and the file its output goes to."""
    words = shlex.split(command.removeprefix("observer-rt "))
    if ">" in words:
        position = words.index(">")
        return words[:position], Path(words[position + 1])
    return words, None


def _in_block(match: re.Match[str]) -> list[str]:
    text = match["indented"] or ("" if match["language"] else match["fenced"])
    lines = (_PROGRAM.match(line.strip()) for line in text.splitlines())
    return [re.sub(r"\s+#.*$", "", found[1]).strip() for found in lines if found]
