"""Entries of findings.json: its small parts, in printed units."""

from typing import Annotated

from pydantic import Field

from observer_rt.foundation.documents import DocumentPart, Figures, Number
from observer_rt.identification.discovery.findings import PrintedFigure
from observer_rt.identification.discovery.report.text import Size
from observer_rt.identification.likelihood.likelihood import Signal
from observer_rt.model.effect import Equation

Gap = Annotated[
    dict[str, Number | bool],
    Field(
        description="rms of model minus measurement: `before` as given, `after` amended, `noise_floor`; with units"
    ),
]


class NamedEffect(DocumentPart):
    """An effect with its sizes by parameter. gap_share: of the disagreement, that it explains; moves: by how much it
    moves the line pressure, rms, and the injected mass, mean."""

    id: str
    parameters: dict[str, Size]
    confidence: Number = None
    indistinguishable_from: tuple[str, ...] = ()
    gap_share: Number = None
    moves: Figures | None = None


class RankedCandidate(DocumentPart):
    """Effects fitted together. chi2: -2 log L, constants left out; n_effective: independent samples."""

    ids: tuple[str, ...]
    held_out_chi2: Number
    chi2: Number = None
    n_effective: Number
    parameters: tuple[dict[str, Size], ...] = ()
    plausible: bool | None = None
    moves: Figures | None = None


class CellOfMap(DocumentPart):
    """Residuals of a signal in a phase at an operating point: nrmse over noise, significance in standard deviations,
    rms; after: with what was found. equation: which is violated, null where none is known to be."""

    signal: Signal
    phase: str = Field(description="closed, opening, open, closing or after")
    equation: Equation | None
    rail_pressure_MPa: Number  # noqa: N815 - units as printed
    open_ms: Number = None
    recording: str = ""
    nrmse: Number
    significance: Number
    rms_MPa: Number = None  # noqa: N815
    rms_mm3_per_ms: Number = None
    after: Figures | None = None


class ProposedTerm(DocumentPart):
    """A law added to an equation. sentence: in words, behind `as if`; latex: with its coefficient and units."""

    equation: str
    law: str
    sentence: str = ""
    latex: str = ""
    coefficient: PrintedFigure
    hardly_told_from: tuple[str, ...]
    depends_on: tuple[str, ...]


class PartEntry(DocumentPart):
    """What a proposal that leaves something may be accepted for. closed: share of the gap held out; left_MPa: rest of
    it beyond noise; mass_ci95_pct: half width of the interval it gives masses; refused: why it may not, empty where
    it may."""

    closed: Number
    left_MPa: Number  # noqa: N815
    mass_ci95_pct: Number
    refused: str = ""


class AlternativeEntry(DocumentPart):
    """Terms of another equation that line pressure cannot tell from a proposal."""

    terms: tuple[ProposedTerm, ...]
    moves: Figures


class LostEntry(DocumentPart):
    """What was fitted and explains less. gain: of -2 log L."""

    terms: tuple[ProposedTerm, ...]
    effects: tuple[str, ...] = ()
    gain: Number


class ProposalEntry(DocumentPart):
    """Terms that would explain the recordings. gain: of -2 log L; adequate: nothing but noise is left; sound: bounded
    over the whole domain; may_enter: whether an amended model may have it; in_part: of one that leaves something but
    has no other objection; lost: of the first, the best of what was fitted beside it."""

    number: int
    sentence: str
    terms: tuple[ProposedTerm, ...] = ()
    effects: tuple[NamedEffect, ...] = ()
    gain: Number = None
    phase: str = ""
    adequate: bool | None = None
    sound: bool | None = None
    may_enter: bool | None = None
    gap_held_out: Figures | None = None
    moves: Figures | None = None
    in_part: PartEntry | None = None
    alternatives: tuple[AlternativeEntry, ...] = ()
    lost: tuple[LostEntry, ...] = ()


class Unknown(DocumentPart):
    """Residuals that the best model leaves, and proposals that would explain them, the best first."""

    equation: Equation
    phase: str
    signal: Signal | None = None
    depends_on: tuple[str, ...]
    term: str
    proposals: tuple[ProposalEntry, ...] = ()


class VisibleSize(DocumentPart):
    """The size from which on an effect would have been seen."""

    id: str
    parameter: str
    value: Number
    unit: str


class StandstillCheck(DocumentPart):
    """A figure of the standstill. recording: null for all together; sigma: null for a noise level."""

    id: str
    recording: str | None
    value: Number
    sigma: Number
    unit: str
    passed: bool
    explained: bool


class InjectionEntry(DocumentPart):
    """What the models miss of the line pressure on one injection, rms. number: in the recording, from 1."""

    recording: str
    number: int
    before_MPa: Number  # noqa: N815
    after_MPa: Number  # noqa: N815


class MassEntry(DocumentPart):
    """By how much what was found changes the mass of an injection at an operating point."""

    recording: str
    nominal_mg: Number
    change_pct: Number
    ci95_pct: tuple[Number, Number]


class ModelSource(DocumentPart):
    """The injector file, its SHA-256, and the effects and terms in it already."""

    file: str
    sha256: str
    in_force: tuple[str, ...]
