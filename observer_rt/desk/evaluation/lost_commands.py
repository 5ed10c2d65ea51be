"""Injections without a command, shown by the line pressure: the commands that explain each best, and its report."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np

from observer_rt.core.stream.stream import EVENT, INJECTION, RING
from observer_rt.engine.estimation import predictor
from observer_rt.engine.estimation.parameters import NEEDLE_LAW, LearnedModel, Theta, learned_of
from observer_rt.engine.learning.event import with_smooth_rail
from observer_rt.engine.learning.knowledge import EventRecord
from observer_rt.engine.learning.verdict import UNEXPLAINED
from observer_rt.engine.observer import WINDOW_LEAD, WINDOW_TAIL, remembered, window_between
from observer_rt.engine.reports.injection_report import InjectionReport, report_of
from observer_rt.engine.service.core import Core
from observer_rt.engine.stream.standstill import standstill_of
from observer_rt.engine.stream.state import Doubt, Reason
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND, MILLISECOND, Floats, Structs
from observer_rt.model.effective import LAG_UNIT

FALL = 3 * MEGAPASCAL  # as core/stream/innovation_monitor.pxi counts it
SWINGS_FOR = 3  # times the gap between events, after the needle has shut, likewise
LOUD = 4.5  # standard deviations of an innovation that noise does not have
SCALE = 3.0  # standard deviations, beyond which an innovation counts by its logarithm
STEP = 50 * MICROSECOND  # of the starts and lengths tried; a line swings in some 500
EARLIEST, LATEST = -3, 1  # steps by which the needle may open before the first loud innovation
MOST_SHOTS = 6
LEAST_GAIN = 1 * MILLISECOND  # of samples, each a nat less: what a shot that pays for a wrong model does not gain
BURST = 0.3 * MILLISECOND  # between loud innovations, from which on they are of two shots
ROUNDS, HALVINGS, ENOUGH = 8, 4, 0.1  # of Gauss and Newton; the last lowers the cost by less


@dataclass(frozen=True, eq=False)
class CommandSearch:
    """Searches commands that explain a window; theta (m,): as learned; sigma: of white innovations [p_0]."""

    window: predictor.Window
    setting: predictor.Setting
    theta: Theta
    sigma: float

    @cached_property
    def learned(self) -> LearnedModel:
        """The model as learned."""
        return learned_of(self.theta, self.setting.coefficients)

    def commands(self, onset: int, end: int) -> Floats:
        """Commands (k, 2) as of `Window`, one after another, that explain a line pressure odd from onset to end."""
        commands, cost = predictor.NO_COMMANDS, self._cost(predictor.NO_COMMANDS)
        while onset < end and len(commands) < MOST_SHOTS:
            trials = (*self._with_shot(commands, onset, end), *self._with_pause(commands))
            longer = self._refined(min(trials, key=self._cost))
            if cost - self._cost(longer) < LEAST_GAIN / self.setting.interval:
                break
            commands, cost = longer, self._cost(longer)
            onset = self._left(commands, end)
        return commands

    def _left(self, commands: Floats, end: int) -> int:
        """The sample at which most of the loud innovations behind the commands begin; end: none are loud."""
        loud = np.flatnonzero(np.abs(self._innovations(commands)) > LOUD * self.sigma)
        later = loud[loud > commands[-1, 1]]
        bursts = np.split(later, np.flatnonzero(np.diff(later) > BURST / self.setting.interval) + 1)
        return int(max(bursts, key=len)[0]) if later.size else end - int(loud.size > 0)

    def _with_shot(self, commands: Floats, onset: int, end: int) -> Iterator[Floats]:
        """The commands and another one, whose needle opens at `onset` or a little before."""
        step, longest = STEP / self.setting.interval, np.array([[onset, end + self.window.output.size]], np.float64)
        (stroke,) = self.window._replace(commands=longest).strokes(self.learned, self.setting)
        assert stroke is not None
        delay = stroke.opening / self.setting.interval - onset
        for start in onset - delay + step * np.arange(EARLIEST, LATEST + 1):
            for length in np.arange(step, end - onset + 4 * step, step):
                yield np.vstack((commands, (start, start + length)))

    def _with_pause(self, commands: Floats) -> Iterator[Floats]:
        """The commands with a pause in the last one, which may stand for two."""
        for start, end in commands[-1:]:
            edges = np.arange(start, end, 2.0 * STEP / self.setting.interval)[1:]
            for pause, again in combinations(edges, 2):
                yield np.vstack((commands[:-1], (start, pause), (again, end)))

    def _refined(self, commands: Floats) -> Floats:
        """The commands moved in time to the least cost near by."""
        cost, numbers = self._cost(commands), NEEDLE_LAW.columns.size
        samples, longest = self.window.output.size, 2.0 * STEP / self.setting.interval
        for _ in range(ROUNDS):
            left, slopes = np.empty(samples), np.empty((samples, numbers + commands.size))
            window = self.window._replace(commands=commands)
            predictor.innovations_with_sensitivity(window, self.setting, self.theta, left, slopes, NEEDLE_LAW.columns)
            by_shots, weights = slopes[:, numbers:], 1.0 / ((SCALE * self.sigma) ** 2 + left**2)
            step = np.linalg.lstsq(by_shots.T * weights @ by_shots, -by_shots.T @ (weights * left), rcond=None)[0]
            move = np.clip(step * LAG_UNIT / self.setting.interval, -longest, longest).reshape(-1, 2)
            trials = [commands + move / 2**halving for halving in range(HALVINGS)]
            ordered = [trial for trial in trials if (np.diff(trial.ravel()) > 0.0).all()]
            before, commands = cost, min((*ordered, commands), key=self._cost)
            cost = self._cost(commands)
            if before - cost < ENOUGH:
                break
        return commands

    def _innovations(self, commands: Floats) -> Floats:
        result = np.empty(self.window.output.size)
        predictor.innovations(self.window._replace(commands=commands), self.setting, self.learned, result)
        return result

    def _cost(self, commands: Floats) -> float:
        """Cost of innovations that may be far off, for a worn injector is not known yet, or a shot still missing."""
        return float(np.log1p((self._innovations(commands) / (SCALE * self.sigma)) ** 2).sum())


@dataclass(eq=False)
class LostCommands:
    """Reports injections without a command, of an observer whose needle answers commands."""

    core: Core
    _counted: int = 0  # of those that the observer counts
    _reported_to: int = 0  # position
    _events: int = 0

    def reports(self) -> Iterator[InjectionReport]:
        """Reports of injections that came to light since the last call; they and their events number from 1."""
        observer = self.core.compiled.observer
        memory, timing = observer.memory[0], observer.constants.timing
        count = int(memory["counts"]["unseen_injections"])
        if observer.constants.needle is None or count == self._counted:
            return
        recorded = int(memory["positions"]["received"]) - max(observer.constants.sensor.late, 0)
        processed = min(self.core.processed, recorded)  # whose line pressure is known
        first = max(self._reported_to, processed - RING + timing.event_gap)
        rows = remembered(observer.ring, first, processed)
        stops = np.flatnonzero((rows["seat_area"] > 0.0) | (rows["broken"] != 0))
        for onset, last in self._falls(rows, opened=-1 if first > self._reported_to else -RING):
            ahead = stops[stops > last]
            end = min(last + timing.event_gap, *(ahead[:1] - timing.learning_lead), processed - first)
            if last + timing.event_gap > processed - first and not memory["mode"]["draining"]:
                return  # it may go on
            self._events += 1
            self._reported_to = first + end
            yield from self._reports(first + onset, first + last, first + end)
        self._counted = count

    def _falls(self, rows: Structs, opened: int) -> Iterator[tuple[int, int]]:
        """First and last loud sample of falls of the line pressure; opened: last sample of an open needle before."""
        observer = self.core.compiled.observer
        gap, scale = observer.constants.timing.event_gap, observer.constants.coefficients.pressure_scale
        numbers = np.arange(len(rows))
        last_open = np.maximum.accumulate(np.where(rows["seat_area"] > 0.0, numbers, opened))
        weight = float(observer.memory[0]["innovation_noise"]["weight"])
        is_watched = np.isfinite(rows["injection_rate"]) & (rows["doubt"] == Doubt.NONE)
        is_loud = rows["innovation"] ** 2 * weight > LOUD**2
        loud = np.flatnonzero(is_watched & is_loud & (numbers - last_open > SWINGS_FOR * gap))
        for part in np.split(loud, np.flatnonzero(np.diff(loud) > gap) + 1):
            fall = rows[part[0] : part[-1] + 1] if part.size else rows[:0]
            if fall.size and float((fall["rail_pressure"] - fall["line_pressure"]).max()) * scale > FALL:
                yield int(part[0]), int(part[-1])

    def _reports(self, onset: int, last: int, end: int) -> Iterator[InjectionReport]:
        """Reports of the injections of one event by positions: the line pressure is odd in [onset, last]."""
        observer, learner, knowledge = self.core.compiled.observer, self.core.learner, self.core.knowledge
        constants, memory = observer.constants, observer.memory[0]
        rate = 1.0 / constants.interval
        lead, tail = round(WINDOW_LEAD * rate), round(WINDOW_TAIL * rate)
        start = onset - 2 * constants.timing.learning_lead
        window = window_between(observer, start, end, onset, int(memory["counts"]["injections_begun"]))
        standstill = standstill_of(memory, constants.coefficients.pressure_scale, memory["prior"]["stated_noise"])
        setting, sigma = learner.reader.setting_at(knowledge.in_force, learner.state.noise, constants)
        search = CommandSearch(with_smooth_rail(window, constants), setting, knowledge.in_force, sigma)
        window = window._replace(commands=search.commands(onset - start, last - start))
        outcome = learner.explain(window, standstill, knowledge.in_force, constants)
        is_explained = outcome.outliers < LEAST_GAIN * rate and not any(
            each.reason in UNEXPLAINED for each in outcome.objections
        )
        again = outcome.resimulated if is_explained else None
        event = np.zeros(1, EVENT)[0]
        event["number"], event["start_position"] = self._events, start
        judged = EventRecord(event, (), None if again is None else outcome, False, knowledge, constants)
        strokes = [] if again is None else [(stroke.opening, stroke.closed) for stroke in again.strokes]
        spans = [(start + int(opening * rate), start + int(shut * rate) + 1) for opening, shut in strokes]
        for opening, shut in spans or [(onset, last)]:
            yield report_of(self._injection(max(opening - lead, start), min(shut + tail, end - 1)), judged, None)

    def _injection(self, start: int, end: int) -> Any:
        """An injection of the last event, in a window of positions that the observer ran with a shut needle."""
        ring, injection = self.core.compiled.observer.ring, np.zeros(1, INJECTION)[0]
        middle = (start + end) // 2 % RING
        injection["event"], injection["start_position"], injection["end_position"] = self._events, start, end
        injection["start_index"], injection["end_index"] = ring["index"][start % RING], ring["index"][end % RING]
        injection["volume"] = injection["predicted_volume"] = injection["peak_rate"] = math.nan
        for name in ("rail_pressure", "state"):
            injection[name] = ring[name][start % RING]
        injection["known_from"], injection["known_to"], injection["reason"] = -math.inf, math.inf, Reason.NO_COMMAND
        injection["middle_x"] = self.core.compiled.observer.x_hat[middle, :3]
        injection["middle_u"] = ring["rail_pressure"][middle], 0.0
        return injection
