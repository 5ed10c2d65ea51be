"""Options that name recordings and CAN logs with their formats, and the options of `evaluate`."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from observer_rt.config.bench import EXAMPLE_BENCH
from observer_rt.files import formats
from observer_rt.foundation import options
from observer_rt.foundation.options import Argument, Option

SIGNALS = ", ".join(formats.suffixes_of(formats.SIGNALS))
LOGS = ", ".join(formats.suffixes_of(formats.LOGS))
RECORDED = ", ".join(formats.LOGS_WRITTEN)

Recording = Annotated[Path, Argument(f"Recording ({SIGNALS}) or CAN log ({LOGS}).", "RECORDING")]
Recordings = Annotated[tuple[Path, ...], Argument(f"Recordings ({SIGNALS}) or CAN logs ({LOGS}).", "RECORDING")]


@dataclass(frozen=True)
class EvaluateOptions:
    """Options of `evaluate`."""

    recordings: Recordings
    bench: options.BenchFile = EXAMPLE_BENCH
    model: options.Model = None
    state: options.State = None
    save_state: Annotated[Path | None, Option("File to which the learned state is written.")] = None
    no_learning: Annotated[bool, Option("Keep the model as it is at the start.")] = False
    chain: Annotated[bool, Option("Treat the recordings as one history: learning continues from file to file.")] = (
        False
    )
    output: Annotated[
        Path | None, Option("Trace, one row a sample (.csv, .mf4, .parquet); a folder for several.", "FILE|DIR")
    ] = None
    plot: Annotated[Path | None, Option("Figure (png, svg, pdf): curves of some injections, masses, wear.")] = None
    map: Annotated[
        Path | None,
        Option("Masses by rail pressure and energizing time (CSV), such as a test plan, to compare with."),
    ] = None
    from_channel: options.FromChannel = ()
    injector: options.Injector = None
    force: options.Force = False
    json: options.Json = False

    @property
    def has_folder(self) -> bool:
        """Whether traces go into `output`, each a file of its own."""
        output = self.output
        return output is not None and (output.is_dir() or not (output.suffix or output.exists()))

    @property
    def written(self) -> Mapping[str, Path]:
        """Paths to be written, by option."""
        named = {"--output": self.output, "--plot": self.plot, "--save-state": self.save_state}
        return {option: path for option, path in named.items() if path is not None}
