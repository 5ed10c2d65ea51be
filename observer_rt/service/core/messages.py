"""Summary and status frames: named values into payloads."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from observer_rt.bus.database.codec import encode
from observer_rt.bus.database.e2e import UNPROTECTED, protect
from observer_rt.bus.mapping.output_messages import OutputMessage, OutputPage
from observer_rt.estimation.scalars import NOZZLE, OFFSET, SEAT
from observer_rt.foundation.units import CUBIC_MILLIMETRE, MEGAPASCAL, MILLIGRAM, MM3_PER_MS
from observer_rt.service.core.injection_report import InjectionReport


class OutputFrame(NamedTuple):
    """A frame to be sent."""

    frame_id: int
    is_extended: bool
    is_fd: bool
    payload: bytes
    bus: int = 0
    """Number of the bus it goes out on."""


class FrameWriter:
    """Writes frames of one message from named values; counts for the end-to-end protection."""

    def __init__(self, message: OutputMessage) -> None:
        self._message = message
        self._counter = 0

    def write(self, values: Mapping[str, float]) -> list[OutputFrame]:
        """A frame for every page, values in the database's units; signals not named are not available."""
        return [self._write(page, values) for page in self._message.pages]

    def _write(self, page: OutputPage, values: Mapping[str, float]) -> OutputFrame:
        layout = self._message.layout
        payload = page.blank.copy()
        encode(np.array([values.get(name, np.nan) for name in page.names]), page.table, payload)
        protect(
            payload,
            layout.length,
            layout.e2e_profile or UNPROTECTED,
            layout.e2e_data_id or 0,
            self._counter,
        )
        self._counter += 1
        return OutputFrame(layout.frame_id, layout.is_extended, layout.is_fd, payload.tobytes(), layout.bus)


def summary_values(
    report: InjectionReport, injector_id: int, learning: bool, pressure_scale: float
) -> dict[str, float]:
    """Signals of `InjectionSummary`; pressure_scale p_0 [Pa]."""
    wear = report.indicators
    return {
        "SampleIndex": report.start_index & 0xFFFFFFFF,
        "Valid": report.valid,
        "Learning": learning,
        "State": report.state,
        "EndIndex": report.end_index & 0xFFFFFFFF,
        "InjectionNumber": report.number & 0xFFFFFFFF,
        "EventNumber": report.event & 0xFFFFFFFF,
        "PhiVersion": report.phi_version & 0xFFFF,
        "InjectorId": injector_id,
        "Reason": report.reason,
        "Mass": report.mass / MILLIGRAM,
        "MassSigma": _mass_sigma(report) / MILLIGRAM,
        "Volume": report.volume / CUBIC_MILLIMETRE,
        "RailPressureAtStart": report.rail_pressure / MEGAPASCAL,
        "PeakInjectionRate": report.peak_rate / MM3_PER_MS,
        "NozzleWear": wear[NOZZLE].value,
        "NozzleWearSigma": _known(wear[NOZZLE].sigma),
        "SeatWear": wear[SEAT].value,
        "SeatWearSigma": _known(wear[SEAT].sigma),
        "LinePressureOffset": wear[OFFSET].value * pressure_scale / MEGAPASCAL,
    }


def _known(sigma: float | None) -> float:
    return np.nan if sigma is None else sigma


def _mass_sigma(report: InjectionReport) -> float:
    """Standard deviation [kg] of the mass: within 1.96 of it lies the 95 % interval, whose middle is another mass.

    nan without an interval.
    """
    if report.mass_ci95 is None:
        return np.nan
    return max(abs(bound - report.mass) for bound in report.mass_ci95) / 1.96
