"""The plant's injector and what may be wrong with it, as numbers. Imports nothing of `observer_rt`."""

import math
from typing import NamedTuple


class Injector(NamedTuple):
    """A new injector and its line; SI. The check figures of the nominal part: 77/101/121 mg for 1.9 ms."""

    density: float = 830.0
    bulk_modulus_line: float = 1.6e9
    bulk_modulus_sac: float = 1.6e9
    vapour_pressure: float = 2.0e3
    line_length: float = 0.15
    line_area: float = math.pi / 4 * 2.4e-3**2
    line_volume: float = 0.9e-6
    line_loss: float = 8.0
    line_cells: int = 1
    line_damping: float = 0.0  # m2/s, of waves; only between cells
    seat_coefficient: float = 0.75
    seat_diameter: float = 2.2e-3
    seat_half_angle: float = math.radians(30.0)
    max_lift: float = 0.30e-3
    nozzle_area: float = 0.78 * 8 * math.pi / 4 * 0.17e-3**2  # with its flow coefficient
    sac_volume: float = 0.075e-6
    chamber_pressure: float = 5.0e6
    drained_by_seat: int = 0  # 1: mass balance; 0: the paper's simplification, drained by the nozzle flow
    stiffening: float = 0.0  # K_1 of K = K_0 + K_1 p, whose K_0 and density are then those without pressure


class Faults(NamedTuple):
    """What differs from the new injector and from true sensors; all 0 is healthy. SI, laws by their usual ids."""

    orifice_area: float = 0.0
    seat_area: float = 0.0
    guide_leakage: float = 0.0  # m3/(s Pa)
    chamber_pressure_rise: float = 0.0  # Pa, growing with the lift
    chamber_pressure_step: float = 0.0  # Pa, while the needle is open
    chamber_pressure_share: float = 0.0  # of the step, that grows with the lift instead
    orifice_cavitation: float = 0.0  # N_crit - 1
    line_friction: float = 0.0
    bulk_modulus: float = 0.0
    bulk_modulus_slope: float = 0.0  # n of K = K_0 + n (p - 100 MPa), in the line
    line_volume: float = 0.0
    fuel_density: float = 0.0
    entrained_air: float = 0.0  # g of 1/K_eff = 1/K + g/p, in the line
    seat_lift_loss: float = 0.0  # a of 1 - a exp(-lift/x_c)
    seat_lift_scale: float = 50e-6  # x_c, m
    seat_outflow: float = 0.0  # share of the line's drain that is the seat flow
    nozzle_lift_loss: float = 0.0  # of the nozzle's coefficient at small lift, as of the seat's
    line_inertance: float = 0.0
    sac_stiffness: float = 0.0
    line_pressure_sensor_lag: float = 0.0  # s
    channel_skew: float = 0.0  # s
    line_pressure_sensor_offset: float = 0.0  # Pa
    line_pressure_sensor_gain: float = 0.0
    rail_pressure_sensor_offset: float = 0.0  # Pa
    rail_pressure_sensor_gain: float = 0.0
    lift_offset: float = 0.0  # m
    lift_gain: float = 0.0
    lift_sensor_lag: float = 0.0  # s


def with_faults(part: Injector, faults: Faults) -> Injector:
    """The injector with those of its own numbers that the faults change."""
    return part._replace(
        density=part.density * (1.0 + faults.fuel_density), line_volume=part.line_volume * (1.0 + faults.line_volume)
    )
