"""Bench and injector files of another format, or damaged: read, or refused by name, never a traceback."""

import re
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, load_bench, load_injector
from observer_rt.daemon.state_file import model_hash
from observer_rt.foundation.errors import UserError
from tests.config.test_bench import injector_file
from tests.daemon.samples import damage

Load = Callable[[Path], object]
FILES = pytest.mark.parametrize(("source", "load"), [(NOMINAL_INJECTOR, load_injector), (EXAMPLE_BENCH, load_bench)])
STRANGE = (
    *("nan", "inf", "-inf", "1e999", "-1", "0", "1" * 5_000, '""', "true", "[]", "{}", "{ a = 1 }"),
    *("1979-05-27", "07:32:00", "[" * 3_000 + "]" * 3_000, '"\\u0000"', "'''x'''", "0x10", "[1, [2, '3']]"),
)


def place_of_refusal(load: Load, path: Path) -> str | None:
    try:
        load(path)
    except UserError as error:
        return error.location
    return None


@pytest.mark.parametrize(
    ("lines", "location"),
    [
        ("[link]\nfd" + ".a" * 20_000 + " = 1", ":2"),
        ("[link]\nfd" + ' . "\\""' * 2_000 + " = 1", ":2"),
        ("[sampling" + ".a" * 2_000 + "]", ":1"),
        ("[link]\nfd = " + "[" * 3_000 + "]" * 3_000, ":2"),
        ("[link]\nfd = " + "{a.b.c.d = [[], " * 100 + "]}" * 100, ": link"),
    ],
    ids=["key", "quoted key", "section", "lists", "lists and keys"],
)
def test_what_is_nested_without_end_is_refused_cheaply(tmp_path: Path, lines: str, location: str) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(lines)
    tracemalloc.start()
    with pytest.raises(UserError, match="more than 32 sections or lists") as refused:
        load_bench(path)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert refused.value.location == f"{path}{location}"
    assert most < 20e6


def test_injector_file_from_before_there_were_formats(tmp_path: Path) -> None:
    path = injector_file(tmp_path, "format = 1 ", "")
    assert model_hash(load_injector(path)) == model_hash(load_injector())


@FILES
@given(data=st.data())
def test_bad_bytes(tmp_path_factory: pytest.TempPathFactory, source: Path, load: Load, data: st.DataObject) -> None:
    path = tmp_path_factory.getbasetemp() / source.name
    path.write_bytes(source.read_bytes())
    damage(path, data)
    refused = place_of_refusal(load, path)
    assert refused is None or str(path.parent) in refused


@FILES
@given(number=st.integers(0, 40), value=st.sampled_from(STRANGE) | st.integers().map(str))
@example(number=0, value="[" * 3_000 + "]" * 3_000)
def test_strange_values(
    tmp_path_factory: pytest.TempPathFactory, source: Path, load: Load, number: int, value: str
) -> None:
    path = tmp_path_factory.getbasetemp() / source.name
    text = source.read_text()
    values = list(re.finditer(r"(?m)^\w+ = (\S+)", text))
    start, end = values[number % len(values)].span(1)
    path.write_text(text[:start] + value + text[end:])
    refused = place_of_refusal(load, path)
    assert refused is None or str(path.parent) in refused
