"""Opens the recordings that a user names: files of signals, and CAN logs, which the daemon's own code decodes."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from observer_rt.bus.links.link import BLOCK_FRAMES, BusFrame, block_of
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench
from observer_rt.config.injector_sections import Meaning
from observer_rt.config.signals import Role, as_sent
from observer_rt.daemon.signal_watch import OUTSIDE_REMEDY
from observer_rt.desk.evaluation.log_causes import DecodedLog, LogWatch, clocks_apart, odd_stamps, refusal
from observer_rt.engine.service.core import Core
from observer_rt.engine.signal_survey import refuse_implausible
from observer_rt.files.channels import InputFrames, chosen_channels
from observer_rt.files.formats import is_log, open_recording
from observer_rt.files.signals.recording import COMPANION_SUFFIXES, Chunk
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE, SignalStream, Stretch
from observer_rt.foundation.console import progress_bar, say
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Floats, Structs, first_of

LARGEST_HOLE = 1 << 28  # samples between two that came


class LoggedSignals(SignalStream):
    """A log decoded by a bench file: the samples that the observer received. A restart of the device splits it.

    Raises `UserError` for a log that is malformed or holds no input of the bench.
    """

    def __init__(
        self,
        bench: Bench,
        path: Path,
        from_channels: Sequence[str] = (),
        progress: Callable[[float], None] = lambda _: None,
    ) -> None:
        """from_channels: texts of `--from-channel`; progress: share done, 0 to 1."""
        super().__init__(path)
        sampling = bench.injector.config.sampling
        self.meaning = sampling.meaning
        self.has_lift = bench.injector.config.signals.needle_lift is not None
        # The samples as they were sent; the reader of this class accounts for their meaning.
        bench = bench.with_sections(
            sampling=sampling.model_copy(update={"meaning": Meaning.INSTANT}),
            signals=as_sent(bench.injector.config.signals),
        )
        self._bench = bench
        self._bus = map_bus(bench)
        needed = {layout.bus for layout in self._bus.input_layouts}
        self.frames = InputFrames(path, self._bus, chosen_channels(path, bench.config.buses, needed, from_channels))
        self.sample_rate = bench.injector.sample_rate
        self.logged = self._look_through(path, progress)
        """Sample indices of the log, missing ones included, split where a restart of the device begins them anew."""
        self.stretches = tuple(Stretch(0.0, len(indices)) for indices in self.logged)

    def _look_through(self, path: Path, progress: Callable[[float], None]) -> tuple[range, ...]:
        core = Core(self._bench.injector, self._bus, learning=False)
        self._coefficients = core.coefficients
        watch = LogWatch(self._bench.injector, self._bus, core)
        rows_read = 0
        stretches: list[range] = []
        for rows in self._rows(core, watch):
            rows_read += len(rows)
            indices = rows["index"].astype(np.int64)
            for index in np.split(indices, np.flatnonzero(np.diff(indices) <= 0) + 1):  # the device was restarted
                if not index.size:
                    continue
                first = int(index[0])
                before = min(stretches[-1][-1], first) if stretches else first
                steps = np.diff(index, prepend=before)
                if steps.max() > LARGEST_HOLE:
                    problem = f"its sample index jumps by {steps.max()} samples"
                    raise UserError(str(path), problem, "split the log where the index jumps")
                if not stretches or first <= stretches[-1][-1]:
                    stretches.append(range(first, first + 1))
                stretches[-1] = range(stretches[-1].start, int(index[-1]) + 1)
            for role, values in self._signals(rows).items():
                self.survey.take(role, values)
            progress(self.frames.log.share_read)
        log = DecodedLog(self.frames, self._bench, self._bus, watch)
        if rows_read < 2:
            raise refusal(log, rows_read)
        apart = [cause.problem for cause in clocks_apart(log)]
        outside = watch.outside()
        odd = odd_stamps(log, sum(len(indices) - 1 for indices in stretches))
        findings = [*apart, *([f"{outside}\n  remedy: {OUTSIDE_REMEDY}"] if outside else odd), *_restarts(stretches)]
        watched = [] if apart else watch.notes(path)
        self.notes = (*self.frames.notes(), *watched, *(f"{path}: {text}" for text in findings))
        self.counters, self.standstill, self.timing = core.counters, core.standstill, core.timing
        self.slow_noise = core.slow_noise
        """The coloured part of the noise of the last samples at rest."""
        return tuple(stretches)

    def chunks(self) -> Iterator[Chunk]:
        number, first = 0, 0
        held = np.empty(0, np.dtype([]))
        sampling = self._bench.injector.config.sampling.model_copy(update={"bridge_ms": 0.0})  # outliers were sent
        core = Core(self._bench.with_sections(sampling=sampling).injector, self._bus, learning=False)
        for rows in self._rows(core):
            held = rows if not len(held) else np.concatenate((held, rows))
            back = np.flatnonzero(np.diff(held["index"].astype(np.int64)) <= 0)
            while back.size:
                yield from self._placed(held[: back[0] + 1], number, first, len(self.logged[number]))
                held, number, first = held[back[0] + 1 :], number + 1, 0
                back = np.flatnonzero(np.diff(held["index"].astype(np.int64)) <= 0)
            if len(held) > SAMPLES_AT_ONCE:
                end = int(held["index"][-2]) - self.logged[number].start
                yield from self._placed(held, number, first, end)
                first, held = end, held[-3:]  # a lift is interpolated from its neighbours
        yield from self._placed(held, number, first, len(self.logged[number]))

    def _rows(self, core: Core, watch: LogWatch | None = None) -> Iterator[Structs]:
        seen = 0
        for frames in self._together(core, watch):
            core.handle_many(block_of(frames))
            if watch is not None:
                for on, frame in frames:
                    watch.note(on, frame)
            if core.processed > seen:
                yield self._rows_since(seen, core)
                seen = core.processed
        core.finish()
        yield self._rows_since(seen, core)

    def _rows_since(self, seen: int, core: Core) -> Structs:
        """Samples from a position on, whose pressures count from that in the chamber of the injector file."""
        rows = core.rows(seen, core.processed)
        if rise := core.coefficients.chamber_pressure - self._coefficients.chamber_pressure:
            for name in ("rail_pressure", "line_pressure"):
                rows[name] += rise / self._coefficients.pressure_scale
        return rows

    def _together(self, core: Core, watch: LogWatch | None) -> Iterator[list[BusFrame]]:
        """Frames to be handled at once: single ones until there are samples, then all up to the watch's next look."""
        held = []
        for frames in self.frames:
            held.append(frames)
            is_due = watch is not None and watch.is_due(frames.frame.stamp_ns)
            if is_due or len(held) == BLOCK_FRAMES or not core.processed:
                yield held
                held = []
        if held:
            yield held

    def _placed(self, rows: Structs, number: int, first: int, end: int) -> Iterator[Chunk]:
        """Samples [first, end) of a stretch in chunks: the rows at their places, NaN where none came."""
        index = rows["index"].astype(np.int64)
        lift = np.interp(index, index + rows["lift_after"], rows["needle_lift"])
        position = index - self.logged[number].start
        received = ~rows["interpolated"]
        for start in range(first, end, SAMPLES_AT_ONCE):
            stop = min(end, start + SAMPLES_AT_ONCE)
            here = received & (position >= start) & (position < stop)

            def signal(values: Floats) -> Floats:
                placed = np.full(stop - start, np.nan)  # noqa: B023 - called at once
                placed[position[here] - start] = values[here]  # noqa: B023
                return placed

            time = np.arange(start, stop) / self.sample_rate
            rail, line = (signal(self._pressure(rows, name)) for name in ("rail_pressure", "line_pressure"))
            yield Chunk(time, rail, signal(lift), line, None, self.path, self.sample_rate, number, start)

    def _signals(self, rows: Structs) -> dict[Role, Floats]:
        """The lift is that before its interpolation [SI]."""
        came = rows[~rows["interpolated"]]
        pressures = {role: self._pressure(came, role) for role in (Role.RAIL_PRESSURE, Role.LINE_PRESSURE)}
        return {**pressures, Role.NEEDLE_LIFT: came["needle_lift"]} if self.has_lift else pressures

    def _pressure(self, rows: Structs, name: str) -> Floats:
        c = self._coefficients
        pressure: Floats = rows[name] * c.pressure_scale + c.chamber_pressure
        return pressure


def _restarts(stretches: Sequence[range]) -> Iterator[str]:
    if len(stretches) > 1:
        places = [f"after sample {before[-1]}" for before in stretches[:-1]]
        yield f"a device was restarted, or paused, its sample index begins anew: split {first_of(places)}"


def open_source(
    path: Path, bench: Bench | None, from_channels: Sequence[str], console: Console, density: float | None = None
) -> SignalStream:
    """Look through a file, and warn of odd values. from_channels: of a log; density [kg/m3]: None for the bench's.

    Raises `UserError` for a suffix, a file or signals that will not do, and for a log without a bench file.
    """
    if not is_log(path):
        with progress_bar(console, f"looking through {path.name}", None):
            source = open_recording(path, None if bench is None else bench.injector, density)
    elif bench is None:
        problem = f"is missing: it says which signals the frames of {path} carry"
        raise UserError("--bench", problem, "name a bench file")
    else:
        with progress_bar(console, f"decoding {path.name}", 1.0) as progress:
            source = LoggedSignals(bench, path, from_channels, progress)
    refuse_implausible(path, source.survey, source.names)
    for note in source.notes:
        say(console, note)
    return source


def without_companions(paths: Sequence[Path], console: Console) -> list[Path]:
    """The files without truths and shots beside recordings, which `*.csv` catches, too."""
    kept = [path for path in paths if not path.name.endswith(COMPANION_SUFFIXES)]
    if kept and len(kept) < len(paths):
        say(console, f"left out: {len(paths) - len(kept)} files beside recordings, truths or shots")
    return kept or list(paths)


def observer_runs(sources: Sequence[SignalStream]) -> list[list[SignalStream]]:
    """Sources of one history, apart where one observer could not go on: an observer is a run.

    A device of our own sends recordings one after another. A log goes on from that before it where its first sample
    index lies beyond the other's last, as in files a recorder began anew.
    """
    runs: list[list[SignalStream]] = []
    for before, source in zip((None, *sources), sources, strict=False):
        if isinstance(before, LoggedSignals) and isinstance(source, LoggedSignals):
            goes_on = source.logged[0].start >= before.logged[-1].stop
        else:
            with_log = isinstance(before, LoggedSignals) or isinstance(source, LoggedSignals)
            goes_on = before is not None and not with_log
        if goes_on:
            runs[-1].append(source)
        else:
            runs.append([source])
    return runs
