"""Optional inputs of a bench: their readings in frames, handed to their users in the service."""

import math
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.input_tables import ENERGIZING
from observer_rt.config.bench import BenchInjector
from observer_rt.core.frames.frames import READINGS
from observer_rt.engine.reports.injection_report import CommandedOpening, InjectionReport
from observer_rt.engine.reports.news import Listener, MeasuredMass
from observer_rt.engine.service.injector import bench_constants
from observer_rt.engine.service.messages import CompiledPipeline
from observer_rt.engine.stream.state import Reason
from observer_rt.model.surroundings import Surroundings, filed

if TYPE_CHECKING:
    from observer_rt.engine.service.commands import EnergizingFigures, EnergizingWatch


class OptionalInputs:
    """Attends to a bench's optional inputs, which compiled code takes; without any it changes nothing.

    Learning enable 0 holds learning up; surroundings change the model; mass and energizing are only compared.
    """

    def __init__(
        self, injector: BenchInjector, bus: BusMap, compiled: CompiledPipeline, tell: Listener, is_restored: bool
    ) -> None:
        self._injector = injector
        self._is_restored = is_restored
        self._compiled = compiled
        self._rows = bus.inputs.optional
        self._inputs = compiled.pipeline.input_memory
        self._memory = self._inputs.memory[0]
        self._masses = _MassComparison(tell)
        self._watch: EnergizingWatch | None = None
        if bus.energizing:
            from observer_rt.engine.service import commands  # optional: [signals.energizing]

            self._watch = commands.EnergizingWatch(bus.energizing, compiled, tell)
        self._look_on()

    def read(self) -> None:
        """Take the readings that wait; of more than are remembered the oldest are lost."""
        self._memory["is_news"] = False  # first: what comes meanwhile may be read twice, never missed
        first, end = int(self._memory["read"]), int(self._memory["came"])
        oldest = max(first, end - READINGS)
        for number in range(oldest, end):
            reading, values = self._inputs.readings[number % READINGS], self._inputs.values[number % READINGS]
            row = self._rows[reading["row"]]
            if self._watch is not None and row["role"] == ENERGIZING:
                follows = bool(reading["follows"]) and not first < number == oldest
                came = values[: row["signal_count"]].copy()
                self._watch.take(came, int(reading["stamp"]), follows, int(reading["processed"]))
            else:  # no other readings wait for Python
                self._masses.take(float(values[0]), int(reading["closed"]))
        self._memory["read"] = end

    def look(self) -> None:
        """Looks at samples that were observed."""
        self.read()
        if self._watch is not None:
            self._watch.look()
        self._look_on()

    def _look_on(self) -> None:
        self._memory["looks_at_each"] = self._watch is not None and self._watch.looks_at_each

    def answer(self) -> bool:
        """Change the model before samples are observed, or take readings; whether the stream waited for either."""
        if self._memory["is_due"]:
            self._change_model()
        elif self._memory["is_news"]:
            self.read()
        else:
            return False
        return True

    def _change_model(self) -> None:
        """Change the model to the surroundings as measured; unknown ones stay as they were."""
        memory, is_known = self._memory, ~np.isnan(self._memory["measured"])
        wanted = np.where(is_known, memory["measured"], memory["in_force"])
        surroundings = Surroundings(*(None if math.isnan(value) else value for value in wanted.tolist()))
        self._compiled.change_constants(bench_constants(self._injector, self._is_restored, surroundings))
        is_missing = np.any(memory["is_input"] > (is_known | memory["is_assumed"]))
        self._compiled.observer.memory["input_fault"] = Reason.INPUT_STALE if is_missing else Reason.NONE
        memory["in_force"], memory["since_change"], memory["is_due"] = wanted, 0.0, False

    def take(self, surroundings: Surroundings) -> None:
        """Take what no frame carries; it counts until the next. NaN: as before; None: as filed, if it ever was."""
        as_filed = filed(self._injector.parameters, Surroundings._fields)
        for number, (value, otherwise) in enumerate(zip(surroundings, as_filed, strict=True)):
            if value is None and self._memory["is_input"][number]:
                value = otherwise
            if value is not None and not math.isnan(value):
                self._memory["measured"][number], self._memory["is_input"][number] = value, True

    def opening_of(self, injection: np.void) -> CommandedOpening | None:
        """Command of an injection (`stream.state.INJECTION`) that is about to be reported; None: not known."""
        return None if self._watch is None else self._watch.opening_of(injection)

    def on_injection(self, report: InjectionReport) -> None:
        self._masses.on_injection(report)

    @property
    def learning(self) -> bool:
        """Whether an event that closes now is to be learned from, by the bench and by its learning enable."""
        return bool(self._memory["learning"])

    @property
    def energizing(self) -> "EnergizingFigures | None":
        """Figures of commands and openings; None for a bench without energizing."""
        return None if self._watch is None else self._watch.figures


class _MassComparison:
    """Joins measured masses and reports of injections, whichever comes first.

    A positive value, no repeat by a cyclic message, is of the last injection closed before it; the first one counts.
    """

    def __init__(self, on_measured: Callable[[MeasuredMass], None]) -> None:
        self._on_measured = on_measured
        self._value = math.nan
        self._measured = 0  # number of the last injection with a measurement
        self._waiting: deque[tuple[int, float]] = deque()
        self._report: InjectionReport | None = None

    def take(self, mass: float, closed: int) -> None:
        """Take a received value [kg, nan: not available]; closed: injections that were over when it came."""
        is_new = mass != self._value and 0.0 < mass < math.inf
        self._value = mass
        if not is_new or closed == self._measured:
            return
        self._measured = closed
        if self._report is not None and self._report.number == closed:
            self._on_measured(MeasuredMass(self._report, mass))
        else:
            self._waiting.append((closed, mass))

    def on_injection(self, report: InjectionReport) -> None:
        self._report = report
        while self._waiting and self._waiting[0][0] <= report.number:
            number, mass = self._waiting.popleft()
            if number == report.number:
                self._on_measured(MeasuredMass(report, mass))
