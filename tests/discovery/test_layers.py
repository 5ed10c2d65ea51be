"""What discovery may build on: it stands below the service, and knows no bus."""

import subprocess
import sys

ABOVE = ("service", "evaluation", "bus", "cli")


def test_discovery_imports_nothing_from_above() -> None:
    code = "import observer_rt.discovery.command, sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.split(".")[1] for name in done.stdout.split() if name.startswith("observer_rt.")}
    assert "discovery" in loaded
    assert loaded.isdisjoint(ABOVE)
