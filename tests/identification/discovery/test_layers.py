"""What discovery may build on: it stands below the service, and knows no bus and no single effect."""

import re
import subprocess
import sys
from pathlib import Path

import observer_rt.identification.discovery
from observer_rt.model.effects import VOCABULARY

ABOVE = ("daemon", "desk")
DISCOVERY = "observer_rt.identification.discovery"


def test_discovery_imports_nothing_from_above() -> None:
    code = f"import {DISCOVERY}.discover, {DISCOVERY}.report.text, sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.split(".")[1] for name in done.stdout.split() if name.startswith("observer_rt.")}
    assert "identification" in loaded
    assert loaded.isdisjoint(ABOVE)


def test_discovery_names_no_effect() -> None:
    """What it must know of effects they say themselves."""
    an_id = re.compile(rf"\b(apparent_)?({'|'.join(VOCABULARY)})\b")
    modules = list(Path(observer_rt.identification.discovery.__path__[0]).rglob("*.*"))
    assert len(modules) > 20
    named = {path.name: an_id.findall(path.read_text("utf-8")) for path in modules if path.suffix != ".pyc"}
    assert {name: found for name, found in named.items() if found} == {}
