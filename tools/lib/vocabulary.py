"""Counts names and phrases that say little, and fails when there are more than the limits in pyproject.toml.

A pronoun or participle as a name says nothing of the thing, and some phrases hide the subject of a sentence. The
limits only ever fall. usage: vocabulary.py [FILE...]: with files, their places.
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from size import FOLDERS, exit_code, tracked_files

SLACK = 20  # places below the limit from which on it is to be lowered
WORDS = re.compile(r"_*(one|found|each|place|told|given|heard|known|rest|there|beside|such|whole|them|it)_*")
PHRASES = re.compile(r"\b(what is|is none|are none|of which|such a one|mended|told)\b", re.IGNORECASE)
PARTICIPLE = re.compile(r"(?:ed|en|Seen|Told|Heard|Known|Found|Read)$")
NOUNS = re.compile(r"(?:Feed|Bed|Need|Speed|Seed|Token|Screen)$")  # they end as participles do
CYTHON = {".pyx", ".pxd", ".pxi"}
TEXTS = re.compile(r'"""(.*?)"""|#[^\n]*|"[^"\n]*"', re.DOTALL)  # of Cython: docstrings, comments, others
DEFINED = re.compile(  # what a line of Cython declares, runs through or assigns; the name of a member
    r"\s*(?:(?:cp?def|def|ctypedef|class)\b(.*)|for (.*?) in\b|([\w, ]+?) =(?!=)|"
    r"(?!(?:return|yield|raise|not|del|if|elif|else|import|from|include)\b)\w[\w\[\]*: ]*[ *](\w+)$)"
)
SHORT_LIVED = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp, ast.Lambda)


def places(path: Path) -> Iterator[tuple[int, str]]:
    """Line and word of every such name that a file defines, and of every such phrase in its docstrings."""
    text = path.read_text(encoding="utf-8")
    if path.suffix in CYTHON:  # which nothing here reads as a tree
        for said in TEXTS.finditer(text):
            for phrase in PHRASES.findall(said[1] or ""):
                yield 1 + text.count("\n", 0, said.start()), phrase.lower()
        text = TEXTS.sub(lambda said: "\n" * said[0].count("\n"), text)
        for line, code in enumerate(text.split("\n"), 1):
            if defined := DEFINED.match(re.sub(r"(?<![=<>!])=(?!=)[^,)]+", "= ", code).rstrip()):
                words = re.findall(r"\w+", " ".join(filter(None, defined.groups())))
                yield from ((line, word) for word in words if WORDS.fullmatch(word))
        return
    tree = ast.parse(text)
    short_lived = {id(inner) for node in ast.walk(tree) if isinstance(node, SHORT_LIVED) for inner in ast.walk(node)}
    for node in ast.walk(tree):
        line = getattr(node, "lineno", 1)
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef | ast.Module):
            for phrase in PHRASES.findall(ast.get_docstring(node, clean=False) or ""):
                yield line, phrase.lower()
        name = _defined_name(node)
        is_participle = isinstance(node, ast.ClassDef) and PARTICIPLE.search(name) and not NOUNS.search(name)
        if id(node) not in short_lived and (WORDS.fullmatch(name) or is_participle):
            yield line, name


def _defined_name(node: ast.AST) -> str:
    """The name that a node gives to something; empty for a node that only uses names."""
    match node:
        case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
            return name
        case ast.arg(arg=name) | ast.ClassDef(name=name) | ast.FunctionDef(name=name):
            return name
        case ast.ExceptHandler(name=str(name)) | ast.MatchAs(name=str(name)) | ast.alias(asname=str(name)):
            return name
    return ""


def main() -> int:
    """Places of the files named, else how many there are against `[tool.vocabulary]`."""
    if sys.argv[1:]:
        for file in sys.argv[1:]:
            print(*(f"{file}:{line}: {word}" for line, word in places(Path(file))), sep="\n")
        return 0
    counts = {
        part: sum(len([*places(path)]) for path in tracked_files(folder) if path.suffix == ".py")
        for part, folder in FOLDERS.items()
    }
    counts["core"] = sum(len([*places(path)]) for path in tracked_files("observer_rt/core") if path.suffix in CYTHON)
    return exit_code("vocabulary", counts, "places", SLACK, "name it by a noun, write the sentence whole")


if __name__ == "__main__":
    sys.exit(main())
