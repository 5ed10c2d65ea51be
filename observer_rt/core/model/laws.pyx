"""Laws of single elements, for Python: orifices, seat, sensor, neuron; see the headers of these names."""

from observer_rt.core.model cimport hydraulics, network, sensor
from observer_rt.core.model.hydraulics cimport Seat


def root(double difference, double transition) -> float:
    """Signed square root of a pressure difference, linear below the transition pressure."""
    return hydraulics.root(difference, transition)


def seat_area(double lift, double seat_diameter, double half_cone_angle) -> float:
    """Flow area of the needle seat A_S(x_N) [m2] at a lift [m]; 0 for a closed needle; diameter [m], angle [rad]."""
    return hydraulics.seat_area(lift, seat_diameter, half_cone_angle)


def seat_area_slope(double u_2, seat) -> float:
    """Derivative dA_S/dx_N [m] of `seat_area` at the lift that opens u_2 = A_S/A_0; 0 for a closed needle."""
    cdef Seat of_seat = seat._asdict()
    return hydraulics.seat_area_slope(u_2, &of_seat)


def normalised_area(double lift, seat) -> float:
    """u_2 = A_S(x_N)/A_0 of a lift [m]; a flow coefficient that depends on the lift is part of it."""
    cdef Seat of_seat = seat._asdict()
    return hydraulics.normalised_area(lift, &of_seat)


def lagged(double indicated, double pressure_start, double pressure_end, double interval, double lag) -> float:
    """What a sensor with time constant `lag` [s] indicates an interval [s] later; exact for a linear pressure."""
    return sensor.lagged(indicated, pressure_start, pressure_end, interval, lag)


def lagged_slopes(
    double indicated, double pressure_start, double pressure_end, double interval, double lag
) -> tuple[float, float, float, float]:
    """Derivatives of `lagged` with respect to indicated, pressure_start, pressure_end and lag [1/s]."""
    slopes = sensor.lagged_slopes(indicated, pressure_start, pressure_end, interval, lag)
    return slopes.by_indicated, slopes.by_start, slopes.by_end, slopes.by_number[0]


def recorded_mean(
    double indicated_before, double indicated, double pressure_mean, double lag_share, double fraction
) -> float:
    """The recorded mean over a sample interval of a lagged signal, a `fraction` of a sample late."""
    return sensor.recorded_mean(indicated_before, indicated, pressure_mean, lag_share, fraction)


def take_tanh(double[:, ::1] values) -> None:
    """tanh of values (m, n) to within 1e-12, in their place."""
    cdef Py_ssize_t i, k
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            values[i, k] = network.fast_tanh(values[i, k])
