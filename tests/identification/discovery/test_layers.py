"""Discovery knows no single effect."""

import re
from pathlib import Path

import observer_rt.identification.discovery
from observer_rt.model.effects import VOCABULARY


def test_discovery_names_no_effect() -> None:
    """What it must know of effects they say themselves."""
    an_id = re.compile(rf"\b(apparent_)?({'|'.join(VOCABULARY)})\b")
    modules = list(Path(observer_rt.identification.discovery.__path__[0]).rglob("*.*"))
    assert len(modules) > 20
    named = {path.name: an_id.findall(path.read_text("utf-8")) for path in modules if path.suffix != ".pyc"}
    assert {name: found for name, found in named.items() if found} == {}
