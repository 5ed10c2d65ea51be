"""Build hook of hatchling: builds the compiled core, and takes its modules into a wheel."""

import os
import platform
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

sys.path.insert(0, str(Path(__file__).parent))
import build_core

# What `zig cc -target` calls the machine of a wheel, where it is not this one; set by tools/wheel.
TARGET = os.environ.get("OBSERVER_RT_TARGET", "")
BUILT_APART = "OBSERVER_RT_BUILT_APART"  # set by tools/lib/venv.sh, which builds beside pip


class CoreHook(BuildHookInterface):  # type: ignore[type-arg]
    """Makes a wheel one of this processor's, for every CPython from 3.11 on."""

    def dependencies(self) -> list[str]:
        """ziglang, whose `zig cc` is a C compiler, where the machine has none or another one is meant."""
        here = BUILT_APART not in os.environ and build_core.compiler() == build_core.ZIG
        return ["ziglang"] if TARGET or here else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build beside the sources for an editable install, else into the wheel."""
        build_data["pure_python"] = False
        build_data["tag"] = f"cp311-abi3-{_platform()}"
        try:
            if version == "editable":
                if BUILT_APART not in os.environ:
                    build_core.build_in_place()
            else:
                built = build_core.build(build_core.Kind(f"core-{TARGET or 'portable'}", target=TARGET))
                build_data["force_include"] |= {str(path): f"observer_rt/core/{name}" for name, path in built.items()}
        except build_core.CoreBuildError as error:
            sys.exit(f"observer-rt: {error}")


def _platform() -> str:
    """Of a wheel's name; x86_64-linux-gnu.2.17 is manylinux_2_17_x86_64."""
    if not TARGET:
        return f"linux_{platform.machine()}"
    processor, _, libc = TARGET.partition("-linux-gnu.")
    return f"manylinux_{libc.replace('.', '_')}_{processor}"
