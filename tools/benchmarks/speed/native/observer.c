/* The observer's two systems in C: x~ with its gain, x^ with phi, Runge-Kutta 4, a lumped line.
 *
 * Equations as in docs/effects.md and observer_rt/model; written down anew, not taken over. All normalised.
 */
#include <math.h>

enum { HIDDEN = 5, ARGUMENTS = 6, STATES = 3 };

struct model {
    double a1, a2_nozzle, a2_seat, a3, a4, leak, air, chamber_pressure; /* line */
    double a5, a6;                                                      /* sac */
    double seat_transition, nozzle_transition, nozzle_flow;
    double hidden[HIDDEN][ARGUMENTS], output[2][HIDDEN], bias[2], back_pressure[2];
    double gain[STATES]; /* of p_L, Q_L, and of what the sensor shows */
    double lag, interval, offset;
    long substeps;
};

static double restrict_to(double value, double limit)
{
    return value > limit ? limit : value < -limit ? -limit : value;
}

/* Lambert's continued fraction at a quarter of the argument, doubled twice: within 1e-12, as the observer has it. */
static double tanh_of(double argument)
{
    const double y = 0.25 * restrict_to(argument, 20.0), s = y * y;
    double p = y * (135135.0 + s * (17325.0 + s * (378.0 + s)));
    double q = 135135.0 + s * (62370.0 + s * (3150.0 + s * 28.0));
    const double p2 = 2.0 * p * q, q2 = p * p + q * q;
    return 2.0 * p2 * q2 / (p2 * p2 + q2 * q2);
}

static double root(double d, double t)
{
    return d / sqrt(sqrt(d * d + t * t));
}

struct flows {
    double h, s;
};

static struct flows flows_of(const double x[STATES], double rail, double area, const struct model *m)
{
    double h_change = m->bias[0], s_change = m->bias[1];
    for (int i = 0; i < HIDDEN; i++) {
        const double *v = m->hidden[i];
        const double sigma = tanh_of(v[0] * x[0] + v[1] * x[1] + v[2] * x[2] + v[3] * rail + v[4] * area + v[5]);
        h_change += m->output[0][i] * sigma;
        s_change += m->output[1][i] * sigma;
    }
    const double rise = area > 0.0 ? m->back_pressure[0] + m->back_pressure[1] * area : 0.0;
    return (struct flows){root(x[2] - rise, m->nozzle_transition) * (1.0 + h_change),
                          area * root(x[0] - x[2], m->seat_transition) * (1.0 + s_change)};
}

static void slope(const double x[STATES], double rail, double area, const struct model *m, double out[STATES])
{
    struct flows q = {0.0, 0.0};
    if (area > 0.0 || x[2] != 0.0)
        q = flows_of(x, rail, area, m);
    const double pressure = fmax(x[0] + m->chamber_pressure, 0.01);
    const double stiffness = m->air == 0.0 ? 1.0 : pressure / (pressure + m->air);
    out[0] = stiffness * (m->a1 * x[1] - m->a2_nozzle * q.h - m->a2_seat * q.s - m->leak * x[0]);
    out[1] = m->a3 * (rail - x[0]) - m->a4 * x[1] * fabs(x[1]);
    out[2] = m->a5 * q.s - m->a6 * q.h;
}

static void advance(double x[STATES], const double before[2], const double now[2], const struct model *m)
{
    const double step = m->interval / m->substeps;
    for (long i = 0; i < m->substeps; i++) {
        double k1[STATES], k2[STATES], k3[STATES], k4[STATES], y[STATES], u[3][2];
        for (int j = 0; j < 3; j++)
            for (int r = 0; r < 2; r++)
                u[j][r] = before[r] + (i + 0.5 * j) / m->substeps * (now[r] - before[r]);
        slope(x, u[0][0], u[0][1], m, k1);
        for (int r = 0; r < STATES; r++)
            y[r] = x[r] + 0.5 * step * k1[r];
        slope(y, u[1][0], u[1][1], m, k2);
        for (int r = 0; r < STATES; r++)
            y[r] = x[r] + 0.5 * step * k2[r];
        slope(y, u[1][0], u[1][1], m, k3);
        for (int r = 0; r < STATES; r++)
            y[r] = x[r] + step * k3[r];
        slope(y, u[2][0], u[2][1], m, k4);
        for (int r = 0; r < STATES; r++)
            x[r] += step / 6.0 * (k1[r] + 2.0 * (k2[r] + k3[r]) + k4[r]);
    }
}

/* Samples of [rail, area] and of y; tilde, hat: the states at the first sample, then at the last; rates: x^'s Q_H. */
void observe(const struct model *m, long n, const double (*inputs)[2], const double *y, double tilde[STATES],
             double hat[STATES], double *shown, double *rates)
{
    for (long k = 1; k < n; k++) {
        const double before = tilde[0];
        advance(tilde, inputs[k - 1], inputs[k], m);
        const double decay = exp(-m->interval / m->lag), ramp = 1.0 - m->lag / m->interval * (1.0 - decay);
        *shown = decay * *shown + (1.0 - decay) * before + ramp * (tilde[0] - before);
        const double innovation = y[k] - m->offset - *shown;
        tilde[0] += m->gain[0] * innovation;
        tilde[1] += m->gain[1] * innovation;
        *shown += m->gain[2] * innovation;
        advance(hat, inputs[k - 1], inputs[k], m);
        rates[k] = m->nozzle_flow * flows_of(hat, inputs[k][0], inputs[k][1], m).h;
    }
}
