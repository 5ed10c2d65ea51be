"""Pages of the site that are made of the package: options of commands, keys of the bench file, the library."""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_origin

import typer.main
from pydantic.fields import FieldInfo

from observer_rt.config.bench import EXAMPLE_BENCH
from observer_rt.config.bench_file import BenchConfig
from observer_rt.config.toml_file import Allowed, Section
from observer_rt.desk.cli.app import EXIT_CODES, app

BENCH_FILE_HEAD = """# Bench file

What a bench file may hold, made of the models that read it and of the comments of the example file, which
`observer-rt run --print-example-bench` prints complete. Unknown keys are errors. What is not marked as required may
be left out. What differs between [several injectors](several-injectors.md) stands below `[injectors.<name>]`.
"""
API_HEAD = """# API

The public names, from their docstrings; [as a library](library.md) has programs. Units are SI. What a caller can mend
is a `UserError` with place, problem and remedy.
"""
OPTIONS_OF = "commands.md"
LIBRARY = Path(__file__).parents[3] / "docs/library.md"
_ROW = re.compile(r"^\| ([^|]+) \| `(observer_rt[\w.]*)` \| ([^|]+) \|$", re.MULTILINE)
_HEADER = re.compile(r"(?:# )?\[{1,2}([\w.]+)\]{1,2}(?: +#? ?(.*))?$")
_CHOICE = re.compile(r"#   (\w+) = (?:\"[^\"]*\"|\[[^\]]*\]) +(.*)$")
_KEY = re.compile(r"(?:# )?(\w+) = (?:\"[^\"]*\"|\[[^\]]*\]|[^#\s]+)(?: +(?:# )?(\S.*))?$")


def options() -> str:
    """Every command with its arguments and options, below the list that docs/commands.md is."""
    commands: Mapping[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    return "\n## Every option\n" + "".join(_command(name, each) for name, each in commands.items())


def _command(name: str, command: Any) -> str:
    context = typer.Context(command, info_name=f"observer-rt {name}")
    usage = " ".join(command.collect_usage_pieces(context))
    says, _, rest = (command.help or "").partition("\n")
    epilog = (command.epilog or "").replace(EXIT_CODES, "").strip()
    example = re.sub(r"^Example: (.*)$", r"\n    \1\n", f"{rest}\n{epilog}".strip(), flags=re.MULTILINE)
    rows = [row for each in command.params if (row := _option(each, context))]
    table = "| option | meaning |\n|---|---|\n" + "".join(rows) if rows else ""
    return f"\n### observer-rt {name}\n\n{says}\n\n    observer-rt {name} {usage}\n\n{table}\n{example}\n"


def _option(parameter: Any, context: typer.Context) -> str:
    """Row of a parameter as the help writes it; none for what the help leaves out."""
    record = parameter.get_help_record(context)
    if record is None:
        return ""
    written, says = (" ".join(part.split()) for part in record)
    return f"| `{written.replace('|', ' or ')}` | {_escaped(says)} |\n"


def _escaped(words: str) -> str:
    """Words of which outside code nothing is taken for a link, a tag or the end of a cell."""
    marks = {"[": "&#91;", "<": "&lt;", "*": "&#42;", "_": "&#95;"}
    parts = words.replace("|", r"\|").split("`")
    return "`".join(
        part if number % 2 else "".join(marks.get(each, each) for each in part)
        for number, part in enumerate(parts)
    )


class Words(NamedTuple):
    """What the example bench file says: of sections, and of keys by section and name."""

    sections: Mapping[str, str]
    keys: Mapping[tuple[str, str], str]

    def of(self, section: str, key: str) -> str:
        """Words of a key; those of a section beside it where it is not explained twice."""
        own, top = self.keys.get((section, key)), section.split(".")[0].replace("links", "link")
        beside = (
            says for (place, name), says in self.keys.items() if name == key and place.split(".")[0] == top
        )
        return own or next(filter(None, beside), "")


def words_of_example() -> Words:
    """Read the comments of the example bench file."""
    sections: dict[str, str] = {}
    keys: dict[tuple[str, str], str] = {}
    choices: dict[str, str] = {}  # keys of the section that follows
    section, before, last = "", "", None
    for line in EXAMPLE_BENCH.read_text(encoding="utf-8").splitlines():
        if choice := _CHOICE.match(line):
            choices[choice[1]] = choice[2]
        elif header := _HEADER.match(line):
            section, last = header[1], None
            sections[section] = f"{before} {header[2] or ''}".replace("(required)", "").strip()
            keys |= {(section, name): says for name, says in choices.items()}
            choices, before = {}, ""
        elif key := _KEY.match(line):
            last = section, key[1]
            keys[last] = keys.get(last) or re.sub(r"^\(required\);? ?", "", key[2] or "")
        elif last and (more := re.match(r" {8,}# (.*)", line)):
            keys[last] += f" {more[1]}"
        else:
            before = f"{before} {line.lstrip('# ')}" if line else ""
    return Words(sections, keys)


class Place(NamedTuple):
    """A section of the bench file: as it is written, the keys that lead to it, and its model."""

    written: str
    keys: tuple[str | int, ...]
    model: type[Section]


def places(model: type[Section] = BenchConfig, keys: tuple[str | int, ...] = ()) -> Iterator[Place]:
    """Sections below a model, in their order."""
    for name, field in model.model_fields.items():
        section = section_of(field.annotation)
        if section is None:
            continue
        here, written = (*keys, name), ".".join(map(str, (*keys, name)))
        origin = get_origin(field.annotation)
        if origin is tuple:
            yield Place(f"[[{written}]]", (*here, 0), section)
        elif origin is Mapping:
            yield Place(f"[{written}.lift]", (*here, "lift"), section)
        else:
            yield Place(f"[{written}]", here, section)
            yield from places(section, here)


def section_of(annotation: Any) -> type[Section] | None:
    """Model of the section that a key leads to, if any."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return annotation
    return next(filter(None, map(section_of, get_args(annotation))), None)


def bench_file() -> str:
    """The page of the bench file's sections and keys."""
    words = words_of_example()
    alike: dict[type[Section], list[Place]] = {}
    for place in places():
        alike.setdefault(place.model, []).append(place)
    return BENCH_FILE_HEAD + "".join(_sections(group, words) for group in alike.values())


def _sections(group: list[Place], words: Words) -> str:
    """The sections that have the same keys."""
    names = [place.written.strip("[]") for place in group]
    says = " ".join(filter(None, (words.sections.get(name, "") for name in names)))
    says = says[:1].upper() + says[1:]
    rows = "".join(
        f"| `{key}` | {_allowed((*group[0].keys, key))} "
        f"| {_default(field)} | {_escaped(words.of(names[0], key))} |\n"
        for key, field in group[0].model.model_fields.items()
        if section_of(field.annotation) is None
    )
    if not rows:
        return ""
    heading = ", ".join(f"`{place.written}`" for place in group)
    return (
        f"\n## {heading}\n\n{_escaped(says)}\n\n| key | is | default | meaning |\n|---|---|---|---|\n{rows}"
    )


def _allowed(keys: tuple[str | int, ...]) -> str:
    """Text of what may stand at a place, without the example that a mistake is answered by."""
    words = Allowed.at(BenchConfig, keys).in_words()
    return _escaped(re.sub(r", (such as \w+ = (\".*?\"|\[.*?\])|without quotes)", "", words))


def _default(field: FieldInfo) -> str:
    """The value of a key that is left out, as in the file."""
    if field.is_required():
        return "(required)"
    value = field.default
    shown = f"{value:.0f}" if isinstance(value, float) and value.is_integer() else json.dumps(value)
    return "" if value is None else f"`{shown}`"


def api() -> str:
    """The page of the library: the names that the table of docs/library.md lists, from their docstrings."""
    rows = _ROW.findall(LIBRARY.read_text(encoding="utf-8"))
    return API_HEAD + "".join(
        f"\n## {what[0].upper()}{what[1:]}\n\n`{module}`\n\n"
        + "".join(f"::: {module}.{name}\n\n" for name in re.findall(r"`(\w+)`", names))
        for what, module, names in rows
    )
