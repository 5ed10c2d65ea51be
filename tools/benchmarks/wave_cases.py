"""Cases of the richer plant: those of the bars, with the same faults and schedules, on another injector and line."""

from dataclasses import replace

from tools.benchmarks.cases import Case, make_case
from tools.benchmarks.wave_plant import LINES, Variant, real_part

WAVE_CLASSES = (
    "healthy",
    "orifice_area",
    "seat_area",
    "orifice_and_seat_area",
    "guide_leakage",
    "chamber_pressure_rise",
    "orifice_cavitation",
    "line_friction",
    "line_pressure_sensor_offset",
    "line_pressure_sensor_lag",
    "rail_pressure_sensor_offset",
    "bulk_modulus",
    "entrained_air",
    "mixture",
    "wear_averaged_20_khz",
)


def make_wave_case(variant: Variant, class_name: str, master_seed: int, number: int) -> Case:
    """The case with this number; a master seed has one injector. Raises KeyError for an unknown class."""
    case = make_case(class_name, master_seed, number)
    bench = replace(case.bench, injector=real_part(master_seed), line=LINES[variant])
    return replace(case, bench=bench)
