"""What an injector may do for which (19)-(23) have no parameter."""

from typing import NamedTuple


class Departures(NamedTuple):
    """SI, all off by default."""

    leakage: float = 0.0  # c, m3/(s Pa): p_L' gets -K_L/V_L c (p_L - p_C)
    air: float = 0.0  # g of 1/K_eff = 1/K + g/p, in the line
    stiffness_slope: float = 0.0  # n of K = K_L + n (p_L - 100 MPa), in the line
    critical_excess: float = 0.0  # N_crit - 1: the nozzle cavitates below the cavitation number N_crit
    chamber_rise: float = 0.0  # Pa, of p_C in (23) while the needle is open
    chamber_rise_with_seat: float = 0.0  # Pa, of p_C at full lift, in proportion to the seat's area before
    seat_loss: float = 0.0  # a of alpha_S (1 - a exp(-x_N/x_c))
    seat_loss_lift: float = 50e-6  # x_c, m


NO_DEPARTURES = Departures()
