"""Findings of `discover`: the content of the document findings.json and of reports. Inside SI."""

import math
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from typing import Annotated, Any, Literal

from pydantic import Field, PlainSerializer, TypeAdapter, computed_field

from observer_rt.engine.estimation.phases import PHASE_NAMES
from observer_rt.engine.learning.healthy import Healthy
from observer_rt.engine.reports.learned_laws import LearnedLaw
from observer_rt.foundation.documents import DocumentPart, Entry, Figures, Inside, Number, key
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND
from observer_rt.identification.discovery.caveats import Basis, Caveat, caveats_of
from observer_rt.identification.discovery.injections import RATE, InjectionGap, MassChange, ModelGaps, Overlay
from observer_rt.identification.discovery.search.adequacy import Disagreement
from observer_rt.identification.discovery.search.candidates import Candidate, Size
from observer_rt.identification.discovery.search.results import Cell, Discovery, Verdict
from observer_rt.identification.discovery.standstill import StandstillFigure
from observer_rt.identification.likelihood.open_loop import Consequence
from observer_rt.identification.likelihood.signals import Signal
from observer_rt.model.baseline import Remainder
from observer_rt.model.effect import Equation
from observer_rt.model.parameters import EffectInForce
from observer_rt.model.terms.in_force import TermInForce

FINDINGS = "findings.json"
GapEntry = dict[str, dict[str, Number | bool] | None]
LearnedEntry = dict[str, str | float | list[str] | list[float] | list[list[float]] | list[list[bool]]]
"""`LearnedLaw.columns`."""


class RankedCandidate(DocumentPart):
    """Effects fitted together. chi2: -2 log L, constants left out; n_effective: independent samples."""

    ids: tuple[str, ...]
    held_out_chi2: Number
    chi2: Number
    n_effective: Number
    parameters: tuple[dict[str, Size], ...]
    plausible: bool
    moves: Consequence


class CellOfMap(DocumentPart):
    """Residuals of a signal in a phase at a point: nrmse over noise, significance in standard deviations, rms.

    after: with what was found; equation: which is violated, null where unknown.
    """

    signal: Signal
    phase: str = Field(description="closed, opening, open, closing or after")
    equation: Equation | None
    rail_pressure_MPa: Number  # noqa: N815 - units as printed
    open_ms: Number
    recording: str
    nrmse: Number
    significance: Number
    rms_MPa: Number = None  # noqa: N815
    rms_mm3_per_ms: Number = None
    after: Figures


def ranked(candidate: Candidate, findings: "Findings") -> RankedCandidate:
    return RankedCandidate(
        ids=candidate.ids,
        held_out_chi2=candidate.held_out,
        chi2=candidate.statistic,
        n_effective=findings.samples,
        parameters=tuple(candidate.parameters.values()),
        plausible=candidate.plausible,
        moves=candidate.moves,
    )


def cell_of_map(item: Disagreement, findings: "Findings") -> CellOfMap:
    cell = item.before
    return CellOfMap(
        signal=cell.signal,
        phase=PHASE_NAMES[cell.phase],
        equation=item.equation,
        rail_pressure_MPa=cell.rail_pressure / MEGAPASCAL,
        open_ms=cell.duration / MILLISECOND,
        recording=findings.points[cell.recording],
        **_figures(cell),
        after=_figures(item.after),
    )


def _figures(cell: Cell) -> dict[str, float | None]:
    rms = f"rms_{_unit_key(cell.signal.unit)}"
    return {"nrmse": math.sqrt(cell.variance), "significance": cell.excess, rms: cell.rms / cell.signal.si}


def gap_entry(gaps: ModelGaps, _: object) -> GapEntry:
    """Rms of model less measurement by signal, with units: `before`, `after`, `noise_floor`, of masses `measured`."""
    result: GapEntry = {"line_pressure": None, "injection_rate": None}
    for name, gap in gaps.by_name.items():
        unit = _unit_key(gap.unit)
        stated: dict[str, Number | bool] = {f"before_{unit}": gap.before, f"after_{unit}": gap.after}
        is_mass = name == "injected_mass"
        stated |= {"measured": gap.measured} if is_mass else {f"noise_floor_{unit}": gap.noise_floor}
        result[name] = stated
    return result


def _unit_key(unit: str) -> str:
    return unit.replace("/", "_per_")


@dataclass(frozen=True)
class ModelSource:
    """The injector file, its SHA-256, and the effects and terms in it already."""

    file: str
    sha256: str
    in_force: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Findings(Discovery):
    """Results of a discovery with what they rest on."""

    schema: Literal[1] = 1
    best: Annotated[Candidate, Entry(lambda one, _: one.ids, tuple[str, ...])]
    ranking: tuple[Annotated[Candidate, Entry(ranked, RankedCandidate)], ...]
    where: tuple[Annotated[Disagreement, Entry(cell_of_map, CellOfMap)], ...]
    gaps: Annotated[ModelGaps, Entry(gap_entry, GapEntry), key("gap")]
    checks: tuple[StandstillFigure, ...]
    healthy_warning: str  # what healthy recordings say against the model; empty: nothing
    like_inertance: Inside[bool]  # whether another inertance of the line would make the same change
    level_measured: Inside[bool]  # whether the fit of the model had a measured rate or mass
    chosen: tuple[str, ...]  # by the user, among effects that explain as much
    amended_model: str | None  # name of its file; None: nothing is added
    in_force: Inside[tuple[EffectInForce, ...]]  # all effects that it has
    overlays: Inside[tuple[Overlay, ...]]  # injections to be shown
    files: Inside[tuple[str, ...]]  # names of the recordings
    points: Inside[tuple[str, ...]]  # operating points of the files, each counted as a recording
    model: ModelSource = ModelSource("", "", ())
    recordings: Annotated[dict[str, str], Field(description="SHA-256 by file name")]
    judged_in_part: tuple[str, ...]  # files too long to be judged as a whole, and how injections were chosen
    healthy: tuple[str, ...] = ()  # names of healthy recordings
    made: Annotated[datetime, PlainSerializer(lambda made: made.isoformat(timespec="seconds"), str)] = datetime.min
    fitted_on: tuple[str, ...]  # of `points`
    held_out: tuple[str, ...]  # of `points`
    seconds: Annotated[float, PlainSerializer(lambda seconds: round(seconds, 3))] = 0.0
    baseline: Inside[Healthy | None] = None  # what the model leaves of the healthy injector; None: not known
    terms: Inside[tuple[TermInForce, ...]] = ()  # all that the amended model has
    not_accepted: Inside[str] = ""  # why a proposal that the user accepts is not in it; empty: it is
    remainder: Annotated[Remainder | None, Entry(lambda one, _: one is not None, bool), key("in_part")] = None
    injections: tuple[InjectionGap, ...] = ()  # residual of each
    masses: tuple[MassChange, ...] = ()  # by operating point
    learned: tuple[Annotated[LearnedLaw, Entry(lambda law, _: law.columns, LearnedEntry)], ...] = ()
    """Laws of nozzle and seat, as the network learned them from the recordings."""
    folder: Inside[str] = ""  # that all this is written to

    @property
    def noise_ratio(self) -> float:
        """How many times the noise the model as given leaves, in its worst cell or run open loop."""
        gaps = (gap.before / gap.noise_floor for gap in self.gaps.by_name.values() if gap.measured)
        return max((super().noise_ratio, *gaps))

    @property
    def held_apart(self) -> bool:
        """Whether the gaps are those of operating points that the sizes were not fitted to."""
        return set(self.held_out) != set(self.fitted_on)

    @property
    def cell_of_point(self) -> dict[int, Cell]:
        """A cell of the map for every operating point, by the number of the point."""
        return {item.before.recording: item.before for item in self.where}

    @property
    def open_ids(self) -> tuple[str, ...]:
        """The effects found, and those tied with them."""
        every = (self.named.ids, *self.rivals) if self.effects else ()
        return tuple(dict.fromkeys(effect_id for ids in every for effect_id in ids))

    @computed_field  # type: ignore[prop-decorator]
    @property
    def caveats(self) -> tuple[Caveat, ...]:
        """Reservations, the gravest first."""
        measured = RATE in self.gaps.by_name, self.level_measured
        return caveats_of(self, Basis(self.healthy_warning, self.held_apart, *measured, self.like_inertance))

    @property
    def is_open(self) -> bool:
        """Whether several explanations are tied and none was chosen."""
        return self.verdict is Verdict.AMBIGUOUS and not self.chosen and not self.accepted

    def as_json(self) -> dict[str, Any]:
        """findings.json: in printed units."""
        document = adapter().dump_python(self, mode="json", by_alias=True, exclude_unset=True, context=self)
        return {"schema": self.schema, **document}


@cache
def adapter() -> TypeAdapter[Findings]:
    """What writes findings as JSON, and knows the schema of that."""
    return TypeAdapter(Findings)
