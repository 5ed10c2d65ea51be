"""Build hook of hatchling: builds the compiled core, and takes its modules into a wheel."""

import os
import platform
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

sys.path.insert(0, str(Path(__file__).parent))
import build_core

# The wheel's machine, where it is not this one: set by tools/wheel.
PLATFORM_VARIABLE = "OBSERVER_RT_WHEEL_PLATFORM"


class CoreHook(BuildHookInterface):  # type: ignore[type-arg]
    """Makes a wheel one of this processor's, for every CPython from 3.11 on."""

    def dependencies(self) -> list[str]:
        """ziglang, whose `zig cc` is a C compiler, where the machine has none."""
        return [] if build_core.compiler() else ["ziglang"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build beside the sources for an editable install, else into the wheel."""
        build_data["pure_python"] = False
        build_data["tag"] = f"cp311-abi3-{os.environ.get(PLATFORM_VARIABLE) or f'linux_{platform.machine()}'}"
        try:
            if version == "editable":
                build_core.build_in_place()
            else:
                built = build_core.build(build_core.PORTABLE)
                build_data["force_include"] |= {
                    str(path): f"observer_rt/core/{name}" for name, path in built.items()
                }
        except build_core.CoreBuildError as error:
            sys.exit(f"observer-rt: {error}")
