"""Writes stubs (.pyi) of the compiled core's modules, for type checks, from each .pyx and the files it includes.

usage: core_stubs.py [SOURCE.pyx STUB.pyi]...
"""

import re
import sys
from pathlib import Path

HEAD = """from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

{imports}

"""
NUMBERS = dict.fromkeys(("int", "int64_t", "uint64_t"), "int") | dict.fromkeys(("bint", "unsigned char"), "bool")
NUMBERS |= {"double": "float", "": "Any"}
ELEMENTS = {"double": "float64", "int64_t": "int64", "int8_t": "int8", "uint8_t": "uint8", "unsigned char": "bool_"}
INCLUDE = re.compile(r'^include "(.+)"$', re.MULTILINE)
CIMPORT = re.compile(r"^from (\S+) cimport ([^()\n]+$|\([^)]+\))", re.MULTILINE)
EXPORTED = re.compile(r"^globals\(\)\.update\((.+?)\)$", re.MULTILINE | re.DOTALL)
SHOWN = re.compile(r"^cpdef enum:.*\n((?:    .*\n)+)", re.MULTILINE)
ENUM = re.compile(r'=enum_of\(\s*__name__, "(\w+)", ([^)]+)\)')
DOUBLE = re.compile(r"^(?:cdef|    const) double(\[\w+\])? ([A-Z]\w+)", re.MULTILINE)
DECLARED = re.compile(
    r"^cdef class (?P<name>\w+)(?P<base>\(\w+\))?:$"
    r"|^(?P<indent>    |)def (?P<function>__init__|[a-z]\w*)\((?P<parameters>.*?)\) -> (?P<result>.+?):$",
    re.MULTILINE | re.DOTALL,
)
PARAMETER = re.compile(r"(?:const )?(?:(unsigned char|\w+)(\[.+\])? )?(\w+)(?:=(.+))?", re.DOTALL)


def stub_of(source: Path) -> str:
    """Text of the stub of a module."""
    text = INCLUDE.sub(lambda part: (source.parent / part[1]).read_text(), source.read_text())
    lines = _constants(text, source.parent)
    is_public = True
    for match in DECLARED.finditer(text):
        if match["name"]:
            is_public = not match["name"].startswith("_")
            if is_public:
                lines.append(f'class {match["name"]}{match["base"] or ""}:\n    """Compiled."""')
        elif is_public or not match["indent"]:
            declared = re.split(r",\s+(?=[A-Za-z])", match["parameters"].strip(" \n,"))
            parameters = ", ".join(map(_parameter, declared))
            lines.append(f"{match['indent']}def {match['function']}({parameters}) -> {match['result']}: ...")
    header = source.with_suffix(".pxd")
    classes = {
        f"from {module} import {name}"
        for module, names in CIMPORT.findall(text + (header.read_text() if header.is_file() else ""))
        for name in re.findall(r"\w+", names)
        if any(re.search(rf"(: |\(){name}\b", line) for line in lines)
    }
    return HEAD.format(imports="\n".join(sorted(classes))) + "\n".join(lines) + "\n"


def _constants(text: str, folder: Path) -> list[str]:
    """What a module exports by `cpdef enum` and `globals().update`: numbers, else whole; dtypes; tuples; enums."""
    sources = "".join(path.read_text() for path in folder.glob("*.p*"))
    kinds = {name: "tuple[float, ...]" if array else "float" for array, name in DOUBLE.findall(sources)}
    arguments = re.findall(r"\b([A-Z]\w*)=(?:tuple\(|\()?(\w+)", ENUM.sub("", "".join(EXPORTED.findall(text))))
    arguments += re.findall(r"^    ([A-Z]\w+) =()", "".join(SHOWN.findall(text)), re.MULTILINE)
    kinds["dtype_of"] = "np.dtype[np.void]"
    tuples = {name for name, value in arguments if value == "tuple_of"}
    numbers = [f"{name}: {kinds.get(value, 'int')}" for name, value in arguments if name not in tuples]
    for enum, members in ENUM.findall(text):
        numbers += [f"class {enum}(IntEnum):", *(f"    {name} = ..." for name in re.findall(r"(\w+)=", members))]
    return numbers + [f"class {name}(NamedTuple):{_fields(name, sources)}" for name in sorted(tuples)]


def _fields(struct: str, sources: str) -> str:
    """Fields of a named tuple, those of a struct; of structs in it, theirs."""
    body = sources.partition(f"\ncdef struct {struct}:\n")[2].partition("\n\n")[0]
    fields = re.findall(r"^    (unsigned char|\w+) (\w+)", body, re.MULTILINE)
    lines = (f"\n    {name}: {NUMBERS[kind]}" if kind in NUMBERS else _fields(kind, sources) for kind, name in fields)
    return "".join(lines)


def _parameter(declared: str) -> str:
    """A parameter of a Cython function as Python declares it."""
    match = PARAMETER.fullmatch(declared)
    assert match, declared
    kind, array, name, default = match.groups()
    if name == "self":
        return name
    kind = f"NDArray[np.{ELEMENTS.get(kind, 'void')}]" if array else NUMBERS.get(kind or "", kind)
    if default == "None" and kind != "Any":
        kind += " | None"
    return f"{name}: {kind}{' = ...' if default else ''}"


if __name__ == "__main__":
    for module, stub in zip(sys.argv[1::2], sys.argv[2::2], strict=True):
        Path(stub).write_text(stub_of(Path(module)))
