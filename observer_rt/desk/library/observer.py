"""The observer fed sample by sample or block by block, in physical units: the daemon without its bus."""

from collections.abc import Iterable, Iterator
from os import PathLike
from typing import TYPE_CHECKING, NoReturn

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.injector_sections import SamplingConfig
from observer_rt.config.toml_file import validated
from observer_rt.core.stream.stream import RING
from observer_rt.desk.evaluation.histories import starting_knowledge
from observer_rt.desk.library.recordings import path_of
from observer_rt.desk.library.results import KnowledgeHolder
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.reports.injection_report import WITH_BOUND, InjectionReport, Output, columns_of, row_of
from observer_rt.engine.reports.news import News
from observer_rt.engine.service.core import Core
from observer_rt.engine.stream.state import Reason, State
from observer_rt.files.replay.recording_frames import Device
from observer_rt.files.signals.recording import Chunk
from observer_rt.files.signals.stream import cut, followed
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE, MM3_PER_MS, Structs
from observer_rt.model.parameters import InjectorParameters

if TYPE_CHECKING:
    from observer_rt.desk.library.injector import Injector


class SampleObserver(KnowledgeHolder):
    """Observes samples as they come and learns between injections; results come some samples later.

    Samples go through the bench's bus codec, as in the daemon: pressures and lifts have the resolution of the bus.

    Parameters
    ----------
    injector : Injector
        Model, and bench file where it was loaded with one.
    sample_rate_Hz : float
        Of all signals.
    state : path, optional
        Learned state to begin with.

    Raises
    ------
    UserError
        For a rate or a state that cannot serve.
    """

    def __init__(
        self,
        injector: "Injector",
        sample_rate_Hz: float = 100e3,  # noqa: N803 - units as printed
        state: str | PathLike[str] | None = None,
    ) -> None:
        rate = validated(
            SamplingConfig,
            {**injector.bench.injector.config.sampling.model_dump(), "rate_hz": np.asarray(sample_rate_Hz).item()},
            lambda *_: "sample_rate_Hz",
            "bench",
        )
        bench = injector.bench.with_sections(sampling=rate)
        self._parameters = injector.parameters
        self._coefficients = injector.bench.injector.coefficients
        self._reports: list[InjectionReport] = []
        self._rate = sample_rate_Hz
        bus = map_bus(bench)
        before = None if state is None else path_of("state", state)
        restored = starting_knowledge("state", before, injector.parameters, lambda _: None)
        self._core = Core(bench.injector, bus, restored, listeners=[self._hear], assumes_filed=True)
        self._device = Device(bus)
        self._device.begin(sample_rate_Hz)
        self._held: Chunk | None = None
        self._samples_fed = self._seen = 0

    def __repr__(self) -> str:
        count = len(self._reports)
        return f"Observer at {self._rate:g} Hz: {self._samples_fed} samples, {count} injections, {self.state}"

    def feed(
        self,
        rail_pressure_MPa: ArrayLike,  # noqa: N803 - units as printed
        needle_lift_mm: ArrayLike,
        line_pressure_MPa: ArrayLike,  # noqa: N803
    ) -> pd.DataFrame:
        """Give it the next sample, or the next block of samples.

        Parameters
        ----------
        rail_pressure_MPa, needle_lift_mm, line_pressure_MPa : float or array of shape (n,)
            Values; nan: not available.

        Returns
        -------
        DataFrame
            Samples observed since the last call: time_s, injection_rate_mm3_per_ms, valid, state.

        Raises
        ------
        UserError
            For signals of different length.
        """
        signals = [
            np.atleast_1d(np.asarray(values, float)) * factor
            for values, factor in (
                (rail_pressure_MPa, MEGAPASCAL),
                (needle_lift_mm, MILLIMETRE),
                (line_pressure_MPa, MEGAPASCAL),
            )
        ]
        sizes = {values.shape for values in signals}
        if len(sizes) > 1 or signals[0].ndim != 1:
            shapes = ", ".join(str(values.shape) for values in signals)
            raise UserError("feed", f"the signals have the shapes {shapes}", "give each one value a sample")
        if not signals[0].size:
            return self._table([])
        time = (self._samples_fed + np.arange(signals[0].size)) / self._rate
        rail, lift, line = signals
        chunk = Chunk(time, rail, lift, line, sample_rate=self._rate, first=self._samples_fed)
        self._samples_fed += chunk.samples
        joined = chunk if self._held is None else followed(self._held, chunk)
        full = joined.samples - joined.samples % self._device.block
        self._held = cut(joined, full, joined.samples) if full < joined.samples else None
        return self._table(self._sent(cut(joined, 0, full)))

    def finish(self) -> pd.DataFrame:
        """Judge the last event, after the last sample; returns the samples observed since, as `feed` does."""
        rows = [] if self._held is None else list(self._sent(self._held))
        self._held = None
        self._core.finish()
        return self._table([*rows, self._observed()])

    @property
    def injections(self) -> pd.DataFrame:
        """Injections reported so far, a row each, as of `EvaluationResult.injections`."""
        rows = [row_of(WITH_BOUND, Output.PARQUET, report, self._coefficients) for report in self._reports]
        return pd.DataFrame(rows, columns=[*columns_of(WITH_BOUND, Output.PARQUET)])

    @property
    def is_valid(self) -> bool:
        """Whether the injection rate of the last sample observed is to be used."""
        return self._core.is_valid

    @property
    def state(self) -> str:
        """State of the observer, with the reason where it is not valid."""
        state, reason = self._core.state
        return f"{State(state).name}, {Reason(reason).name}" if reason else State(state).name

    @property
    def _learned(self) -> tuple[Knowledge, InjectorParameters]:
        return self._core.knowledge, self._parameters

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "an Observer at work cannot be pickled or copied: keep its tables, or call save_state(path) and begin "
            "another from that: Observer(injector, state=path)"
        )

    def _hear(self, news: News) -> None:
        if isinstance(news, InjectionReport):
            self._reports.append(news)

    def _sent(self, chunk: Chunk) -> Iterator[Structs]:
        """Sends samples in parts that its ring remembers, and yields those observed."""
        step = RING // 4 - RING // 4 % self._device.block
        for first in range(0, chunk.samples, step):
            for block in self._device.blocks(cut(chunk, first, min(chunk.samples, first + step))):
                self._core.handle_many(block)
            yield self._observed()

    def _observed(self) -> Structs:
        """Samples observed since the last call."""
        first, self._seen = self._seen, self._core.processed
        return self._core.rows(first, self._seen)

    def _table(self, parts: Iterable[Structs]) -> pd.DataFrame:
        rows = np.concatenate([self._core.rows(0, 0), *parts])
        return pd.DataFrame(
            {
                "time_s": rows["index"] / self._rate,
                "injection_rate_mm3_per_ms": rows["injection_rate"] / MM3_PER_MS,
                "valid": rows["valid"],
                "state": pd.Categorical.from_codes(rows["state"], [state.name for state in State]),
            }
        )
