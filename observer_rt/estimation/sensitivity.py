"""The columns of every sensitivity and of the parameter vector theta."""

from enum import IntEnum

from observer_rt.model.network import HIDDEN


class Parameter(IntEnum):
    """Columns by name."""

    NOZZLE_BIAS = 0  # b_H
    NOZZLE_WEIGHT = 1  # w_1; w_2 .. w_q follow
    SEAT_BIAS = 1 + HIDDEN  # b_S
    LINE_PRESSURE_OFFSET = 2 + HIDDEN  # o, in units of p_0; acts in the sensor only
    LINE_FRICTION = 3 + HIDDEN  # k
    GUIDE_LEAKAGE = 4 + HIDDEN  # c p_0 / Q_0
    BULK_MODULUS = 5 + HIDDEN  # r
    SENSOR_LAG = 6 + HIDDEN  # tau, in units of LAG_UNIT; acts in the sensor only
    ENTRAINED_AIR = 7 + HIDDEN  # K g / p_0
    BACK_PRESSURE = 8 + HIDDEN  # rise of p_C while injecting, in units of p_0; with the seat area follows


PARAMETERS = 10 + HIDDEN
