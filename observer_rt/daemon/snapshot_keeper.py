"""Snapshots of a daemon, with its faults and status in words: the loop hands over, a client's thread makes them."""

import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.links.descriptor import IdleLink
from observer_rt.config.bench import Bench
from observer_rt.config.signals import in_words
from observer_rt.daemon import snapshot
from observer_rt.daemon.arrivals import inputs_of
from observer_rt.daemon.daemon import Daemon
from observer_rt.daemon.input_watch import ABOUT_INPUTS, LASTING, REPORTED_AFTER
from observer_rt.daemon.snapshot import Fault, StatusLevel, StatusLine
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.reports.injection_report import WITH_BOUND, InjectionReport, Output, none_if_nan, row_of
from observer_rt.engine.reports.news import MeasuredMass, News, Notice
from observer_rt.engine.service.injector import calibration_of
from observer_rt.engine.service.noise import noise_text
from observer_rt.engine.service.nominal import ComparedRate, NominalInjection, References
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.words import REASONS, STATES, TOPICS, Topic, is_good, named
from observer_rt.foundation import units
from observer_rt.foundation.errors import REMEDY

LONGEST_WAIT = 1.0  # s that a client waits for news at the most
_POLL_INTERVAL = 0.01  # s between two looks for news

NOISE_EVERY = 5_000_000_000  # ns between two looks at the spectrum of the noise


class SnapshotKeeper:
    """Listens to the reports of a daemon of one injector, and makes snapshots of it."""

    def __init__(self, bench: Bench, references: References | None = None) -> None:
        """references: models with which injections are compared; None: the nominal model."""
        injector = bench.injector
        nominal = NominalInjection(injector)
        self._c = nominal.coefficients
        self._references: References = references or nominal
        self._calibration = calibration_of(injector)
        self._model = injector.parameters_path.name
        self._rate_hz = injector.sample_rate
        self._run = time.time_ns()
        self._noise, self._noise_due = "", 0  # in words, and when to look at it again [ns]
        self._daemon: Daemon | None = None  # before it runs
        self._notice: snapshot.Fault | None = None  # why it does not run yet
        # The loop appends news and the samples of the last injections; a client's thread takes them out.
        self._news: deque[tuple[InjectionReport | MeasuredMass, int]] = deque(maxlen=snapshot.KEPT)
        self._samples: deque[tuple[InjectionReport, NDArray[np.void]]] = deque(maxlen=snapshot.WITH_CURVES)
        self._lock = threading.Lock()  # of clients only
        self._learned: tuple[Knowledge | None, tuple[Mapping[str, Any], ...]] = None, ()  # and curves of it
        self._count = 0
        self._kept: deque[tuple[InjectionReport, snapshot.ShownInjection]] = deque(maxlen=snapshot.KEPT)

    def watch(self, daemon: Daemon) -> None:
        """Make snapshots of this daemon from now on."""
        self._daemon = daemon

    def hear(self, news: News) -> None:
        """Take in an injection, its measured mass, a fault of a link; called by the loop, so it must not wait."""
        now = time.time_ns()
        if isinstance(news, InjectionReport) and self._daemon is not None:
            self._samples.append((news, self._daemon.core.rows(news.start_position, news.end_position + 1)))
            self._news.append((news, now))
        elif isinstance(news, MeasuredMass):
            self._news.append((news, now))
        elif isinstance(news, Notice) and news.topic is Topic.LINK:
            what, _, remedy = news.text.partition(REMEDY)
            self._notice = None if news.is_over else snapshot.Fault(what, now, remedy)

    def take(self, since: int = 0, with_laws: bool = False) -> snapshot.Snapshot:
        """State now, and all injections kept after the `since`-th; with_laws: also the curves of the learned laws."""
        with self._lock:
            self._take_in()
            injections = [shown for _, shown in self._kept if shown.count > since]
            return snapshot.Snapshot(self._status(with_laws), tuple(injections))

    def answer(self, request: Mapping[str, Any]) -> Iterator[bytes]:
        """Answer a request for injections that are new to a client.

        request: the `run` and the injection `since` which the client wants news, its longest `wait` [s] for them, and
        whether it also wants the curves of the learned `laws`.
        """
        since, wait = int(request.get("since", 0)), min(float(request.get("wait", 0.0)), LONGEST_WAIT)
        if request.get("run") != self._run:
            since, wait = 0, 0.0
        end = time.monotonic() + wait
        while not self._news and self._count <= since and time.monotonic() < end:
            time.sleep(_POLL_INTERVAL)
        return self.take(since, bool(request.get("laws"))).pieces()

    def _take_in(self) -> None:
        pending = [self._news.popleft() for _ in range(len(self._news))]
        samples = {id(report): rows for report, rows in list(self._samples)}  # which come before the news
        for news, moment in pending:
            if isinstance(news, MeasuredMass):
                for number, (report, shown) in enumerate(self._kept):
                    if report is news.report:
                        values = {**shown.values, "measured_mass_mg": news.mass / units.MILLIGRAM}
                        self._kept[number] = report, replace(shown, values=values)
                continue
            self._count += 1
            self._kept.append((news, self._shown(news, samples.get(id(news)), moment)))
            if len(self._kept) > snapshot.WITH_CURVES:
                report, shown = self._kept[-1 - snapshot.WITH_CURVES]
                self._kept[-1 - snapshot.WITH_CURVES] = report, replace(shown, curves={})

    def _shown(self, report: InjectionReport, rows: NDArray[np.void] | None, moment: int) -> snapshot.ShownInjection:
        """Entry of an injection; rows: its samples (n,), None when no longer remembered."""
        compared = () if rows is None else self._references(report, rows)
        values = {
            **row_of(WITH_BOUND, Output.JOURNAL, report, self._c),
            "density_kg_per_m3": none_if_nan(report.density),
            "measured_mass_mg": None,
            "model": self._model,
            "remainder": report.remainder_text,
            "verdict": report.validity if report.valid else f"{report.validity}: {named(report.reason)}",
        }
        masses = {model.name: none_if_nan(model.mass / units.MILLIGRAM) for model in compared}
        curves = {} if rows is None else self._curves(report, rows, compared)
        return snapshot.ShownInjection(self._count, moment, values, masses, curves)

    def _curves(
        self, report: InjectionReport, rows: NDArray[np.void], compared: Sequence[ComparedRate]
    ) -> dict[str, NDArray[np.float32]]:
        chamber = report.surroundings.chamber_pressure or self._c.chamber_pressure

        def pressure(values: units.Floats) -> units.Floats:
            return (values * self._c.pressure_scale + chamber) / units.MEGAPASCAL

        courses = {"corrected_rate": report.corrected_rate, "corrected_rate_sigma": report.rate_sigma}
        rates = {name: course[-len(rows) :] for name, course in courses.items() if course is not None}
        rates |= {"rate": rows["injection_rate"], "rate_sigma": rows["rate_sigma"]}
        rates |= {f"{model.name}_rate": model.rate for model in compared}
        curves = {
            "time_ms": (rows["index"] - rows["index"][:1]) / (self._rate_hz * units.MILLISECOND),
            "rail_pressure_MPa": pressure(rows["rail_pressure"]),
            "needle_lift_um": rows["needle_lift"] / units.MICROMETRE,
            "line_pressure_MPa": pressure(rows["line_pressure"]),
            "modelled_pressure_MPa": pressure(rows["x_hat"][:, 0]),
            **{f"{name}_mm3_per_ms": rate / units.MM3_PER_MS for name, rate in rates.items()},
        }
        return {name: values.astype(np.float32) for name, values in curves.items()}

    def _status(self, with_laws: bool) -> snapshot.Status:
        daemon = self._daemon
        if daemon is None:
            notices = () if self._notice is None else (self._notice,)
            lines = tuple(snapshot.StatusLine(notice.what, snapshot.StatusLevel.BAD) for notice in notices)
            return replace(self._of_state(time.time_ns(), State.STARTING, (), notices), lines=lines)
        now = time.monotonic_ns()
        ahead = time.time_ns() - now  # offset of the wall clock from the monotonic clock [ns]
        state, reasons = daemon.standing(now)
        faults = tuple(replace(fault, since=fault.since + ahead) for fault in faults_of(daemon, now, state, reasons))
        return replace(
            self._of_state((daemon.last_look or now) + ahead, state, reasons, faults),
            lost=daemon.dropped + daemon.core.counters.lost_samples,
            buses=tuple(
                snapshot.BusStatus(port.label, port.down.partition(REMEDY)[0])
                for port in daemon.ports
                if not isinstance(port.link, IdleLink)
            ),
            inputs=inputs_of(daemon.arrivals, daemon.core.timing, now),
            lines=tuple(self._lines(daemon, now)),
            learned=self._laws(daemon.core.knowledge) if with_laws else (),
        )

    def _lines(self, daemon: Daemon, now: int) -> Iterator[snapshot.StatusLine]:
        """Lines of a daemon at a monotonic time [ns]; noise is looked at every few seconds."""
        if daemon.arrivals.is_contested(now):
            text = f"another node sends our results: {daemon.arrivals.foreign_frames} frames"
            yield snapshot.StatusLine(text, snapshot.StatusLevel.BAD)
        yield from link_lines(daemon)
        yield from figure_lines(daemon)
        if (white := daemon.core.standstill.noise) is not None:
            if now >= self._noise_due:
                self._noise, self._noise_due = noise_text(white, daemon.core.slow_noise), now + NOISE_EVERY
            yield snapshot.StatusLine(f"noise: {self._noise}")

    def _laws(self, knowledge: Knowledge) -> tuple[Mapping[str, Any], ...]:
        """Curves learned, worked out once for each event."""
        if knowledge is not self._learned[0]:
            from observer_rt.engine.reports.learned_laws import learned_laws  # where a page asks for them

            laws = learned_laws(knowledge, self._c)
            self._learned = knowledge, tuple(law.columns for law in laws if not law.is_surface)
        return self._learned[1]

    def _of_state(
        self, moment: int, state: State, reasons: Sequence[Reason], faults: tuple[snapshot.Fault, ...]
    ) -> snapshot.Status:
        level = snapshot.StatusLevel.BAD
        if state in (State.STARTING, State.WAITING_FOR_DATA):  # a fault once it lasts
            level = snapshot.StatusLevel.WAITING
        elif is_good(state):
            is_well = self._calibration.is_calibrated and (not reasons or reasons[0] is Reason.JUMPED)
            level = snapshot.StatusLevel.GOOD if is_well else snapshot.StatusLevel.WAITING
        words = named(reasons[0]) if reasons else STATES[state].what
        if is_good(state) and not self._calibration.is_calibrated:
            words += f"; {self._calibration.as_text()}"
        names = tuple(reason.name for reason in reasons)
        return snapshot.Status(self._run, moment, state.name, names, words, level, self._model, faults=faults)


def faults_of(daemon: Daemon, now: int, state: State, reasons: Sequence[Reason]) -> list[Fault]:
    """Faults at a monotonic time [ns], one for each cause, the likeliest first."""
    faults = [
        Fault(f"{port.label} is down: {what}", port.down_since, remedy)
        for port in daemon.ports
        for what, _, remedy in (port.down.partition(REMEDY),)
        if what
    ]
    faults += _silence(daemon, now)
    is_explained = bool(faults) and (not reasons or reasons[0] in ABOUT_INPUTS)
    if is_explained or is_good(state) or now - daemon.stands_since < LASTING * units.NANOSECONDS:
        return faults
    words, name = (REASONS[reasons[0]], reasons[0].name) if reasons else (STATES[state], state.name)
    return [*faults, Fault(f"{name}: {words.what}", daemon.stands_since, words.remedy)]


def _silence(daemon: Daemon, now: int) -> list[Fault]:
    """One fault for all silent messages of buses that are up: they mostly share a device or cable."""
    arrivals = daemon.arrivals
    audible = [source for source in arrivals.sources if daemon.ports[source.layout.bus].is_up]
    ages = {source: arrivals.silence(source, now) for source in audible}
    silent = {source: age for source, age in ages.items() if age > max(REPORTED_AFTER, source.patience)}
    if not silent:
        return []
    texts = tuple(f"{source.text}: no frame for {age:.0f} s" for source, age in silent.items())
    since = now - round(max(silent.values()) * units.NANOSECONDS)
    remedy = TOPICS[Topic.INPUT].remedy
    if len(texts) == 1:
        return [Fault(texts[0], since, remedy)]
    return [Fault(f"no frame of {len(texts)} messages for {min(silent.values()):.0f} s", since, remedy, texts)]


def link_lines(daemon: Daemon) -> Iterator[StatusLine]:
    """A line for each bus that is used."""
    for port in daemon.ports:
        if not isinstance(port.link, IdleLink):
            condition = str(port.link.condition.state) if port.is_up else "down"
            yield StatusLine(
                f"{port.label} {condition}, stamps by {port.link.stamp_source}; lost here {port.link.dropped}, "
                f"unsent {port.unsent}, outages {port.troubles}",
                StatusLevel.BAD if port.is_in_trouble else StatusLevel.GOOD,
            )


def figure_lines(daemon: Daemon) -> Iterator[StatusLine]:
    """Lines of what was received, learned and written, and under which conditions."""
    core = daemon.core
    counters = core.counters
    damaged = counters.crc_errors + counters.length_errors
    yield StatusLine(
        f"{counters.samples} samples, {counters.lost_samples} missing; frames: {damaged} damaged, "
        f"{counters.sequence_errors} out of order, {counters.old_frames} too late"
    )
    if daemon.latency is not None:
        yield StatusLine(daemon.latency.as_text())
    if counters.outliers:
        yield StatusLine(counters.outliers)
    refused = f"{counters.rejected_adoptions} refused, {counters.late_adoptions} late"
    if counters.unlearned_events:
        refused += f", {counters.unlearned_events} events not learned from in time"
    learned = f"learned {counters.adoptions} times in {counters.events} events ({refused})"
    if not core.optional.learning:
        learned += "; learning is off"
    constants = core.compiled.observer.constants
    yield StatusLine("; ".join((learned, *in_words(constants.surroundings))))
    level = (constants.calibration.as_text(), f"rates at {constants.coefficients.density:.0f} kg/m3")
    is_calibrated = constants.calibration.is_calibrated
    yield StatusLine("; ".join(filter(None, level)), StatusLevel.GOOD if is_calibrated else StatusLevel.WAITING)
    if core.optional.energizing is not None:
        is_odd = core.optional.energizing.missing > 0
        yield StatusLine(core.optional.energizing.as_text(), StatusLevel.WAITING if is_odd else StatusLevel.GOOD)
    if daemon.failed_writes:
        text = f"{daemon.failed_writes} failed writes of learned state, journal or log, which says why"
        yield StatusLine(text, StatusLevel.BAD)
