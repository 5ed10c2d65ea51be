"""The loop allocates nothing, however many frames it takes."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

PROGRAM = """
import ctypes, sys
from observer_rt.bus.links.link import BusFrame, Frame, blocks_of
from observer_rt.config.bench import EXAMPLE_BENCH
from tests.device import core_of, frames_of, simulated
allocations = ctypes.CDLL(sys.argv[1]).allocations
allocations.restype = ctypes.c_long
came = [
    BusFrame(0, Frame(each.frame_id, each.payload, each.stamp_ns, each.is_extended))
    for each in frames_of(EXAMPLE_BENCH, simulated())
]
for count in (10, 10, int(sys.argv[2])):  # whatever is made only once is made by the first
    core = core_of(EXAMPLE_BENCH, learning=False)
    taken = most = 0
    for block in blocks_of(came[:count]):
        first = 0
        while first < block.frames:
            before = allocations()
            first, waits = core.compiled.take_many(block, first)
            most = max(most, allocations() - before)
            core._go_on(waits)
            core._results.collect_results()
        taken += block.frames
print(taken, most, core.processed)
"""
REPOSITORY = Path(__file__).parents[2]


def test_frames_cost_no_memory(tmp_path: Path) -> None:
    """As many allocations for 1,500 frames, with an injection, as for ten: those of a call from Python."""
    library = tmp_path / "allocations.so"
    is_checked = "OBSERVER_RT_CHECKED_CORE" in os.environ
    compiler = shlex.split(os.environ.get("CC", "cc"))
    flags = ["-DSANITIZED", "-Wl,--unresolved-symbols=ignore-all"] if is_checked else []
    alone = {name: value for name, value in os.environ.items() if name != "LD_PRELOAD"}
    source = Path(__file__).with_name("allocations.c")
    subprocess.run([*compiler, "-shared", "-fPIC", *flags, "-o", library, source], check=True, env=alone)
    preloaded = ":".join(filter(None, [os.environ.get("LD_PRELOAD"), str(library)]))
    environment = os.environ | {"LD_PRELOAD": preloaded, "PYTHONPATH": str(REPOSITORY)}

    def run(frames: int) -> tuple[int, int, int]:
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, library, str(frames)], capture_output=True, text=True, env=environment
        )
        assert done.returncode == 0, done.stderr
        taken, made, processed = map(int, done.stdout.split())
        return taken, made, processed

    few, many = run(10), run(1500)
    assert many[0] == 1500
    assert many[2] > 12_000
    assert many[1] == few[1]
