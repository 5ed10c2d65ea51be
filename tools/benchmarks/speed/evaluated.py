"""How fast recordings run through `evaluate`, beside the compiled core alone on the same frames."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.evaluation.convert import convert
from observer_rt.evaluation.evaluate import evaluate_stream
from observer_rt.evaluation.logged import LoggedSignals
from observer_rt.recording.formats import open_recording
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.stream import HeldSignals, SignalStream
from tools.benchmarks.scoring import bench_at
from tools.benchmarks.speed.core_alone import Cost, Watch, core_alone, frames_of, repeated_injections
from tools.benchmarks.speed.traffic import SAMPLE_RATE

ARRAYS, PARQUET, MDF4, CAN_LOG = "arrays", "parquet", "mf4", "mf4 CAN log"
REPEATED = 15  # times: 30 s
PASSES = 3


@dataclass(frozen=True)
class EvaluateTimes:
    """The least of interleaved passes; nothing is learned.

    core: compiled code, frames in arrays; verdicts: what Python does beside when events are judged; whole: from a
    source to its results, by source. seconds: of the recording.
    """

    seconds: float
    core: Cost
    verdicts: Cost
    whole: dict[str, Cost]

    def share(self, source: str) -> float:
        """Of the core's speed, by the clock."""
        return self.core.wall / self.whole[source].wall

    def processor_share(self, source: str) -> float:
        """The same by the time of processors."""
        return self.core.processor / self.whole[source].processor


def measure_evaluate(folder: Path) -> EvaluateTimes:
    """Time the core and every source in turn, several times."""
    bench, recording = bench_at(SAMPLE_RATE), repeated_injections(REPEATED)
    sources = _sources(folder, bench, recording)
    blocks = frames_of(bench, recording)
    core, verdicts = Watch(), Watch()
    whole = {name: Watch() for name in sources}
    for _ in range(1 + PASSES):
        core_alone(bench, blocks, core, verdicts)
        for name, opened in sources.items():
            with whole[name].runs():
                evaluate_stream(bench, [opened()], learning=False)
            whole[name].end_pass()
    samples = recording.samples
    found = {name: watch.least(samples) for name, watch in whole.items()}
    return EvaluateTimes(samples / SAMPLE_RATE, core.least(samples), verdicts.least(samples), found)


def _sources(folder: Path, bench: Bench, recording: Recording) -> dict[str, Callable[[], SignalStream]]:
    """How each is opened, the same samples in all."""
    from observer_rt.recording.signals.table_writers import write_whole

    quiet = Console(quiet=True)
    parquet, mdf4, log = folder / "evaluated.parquet", folder / "evaluated.mf4", folder / "frames.mf4"
    for path in (parquet, mdf4):
        write_whole(path, recording)
    trace = folder / "frames.blf"
    convert(mdf4, trace, bench, (), True, quiet)
    convert(trace, log, None, (), True, quiet)
    return {
        ARRAYS: lambda: HeldSignals(recording),
        PARQUET: lambda: open_recording(parquet, bench.injector),
        MDF4: lambda: open_recording(mdf4, bench.injector),
        CAN_LOG: lambda: LoggedSignals(bench, log),
    }
