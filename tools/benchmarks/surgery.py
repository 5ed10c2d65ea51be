"""Whether anything wrong is ever valid: recordings with a fault from a moment on, for every way of learning."""

from observer_rt.foundation.units import MILLISECOND
from tests.daemon.surgery import SAMPLE_RATE, Finding, operate, surgeries
from tools.benchmarks.command_line import app, tracked
from tools.benchmarks.report import Columns, put_out, table_of

COLUMNS: Columns[list[Finding]] = {
    "runs": lambda mine: str(len(mine)),
    "valid": lambda mine: f"{sum(f.valid for f in mine)} of {sum(f.injections for f in mine)}",
    "wrong and valid: injections": lambda mine: str(sum(f.wrong_injections for f in mine)),
    "samples, most in a run": lambda mine: str(max(f.wrong_samples for f in mine)),
    "longest": lambda mine: f"{max(f.longest_run for f in mine) / SAMPLE_RATE / MILLISECOND:.2f} ms",
    "at the end": lambda mine: ", ".join(sorted({f.reason.name for f in mine})),
}


@app.command(epilog="Example: tools/bench surgery")
def surgery() -> None:
    """Whether anything wrong is ever valid: faults in recordings, for every way of learning."""
    by_fault: dict[str, list[Finding]] = {}
    for each in tracked(surgeries(), "surgeries"):
        by_fault.setdefault(each.fault or "none", []).append(operate(each))
    table = table_of("over wear, onsets and ways of learning", "fault", by_fault, COLUMNS)
    put_out(False, None, [table])
