/* Seat, sac, nozzle and line over a sample interval; SI units normalised by p_0, Q_0 and A_0.
 *
 * x = [p_L at the closed end, Q_L into it, p_S, further states of the line]; u = [p_R, A_S].
 */
#ifndef MODEL_H
#define MODEL_H

#include "parameters.h"

enum { P_LINE = 0, Q_LINE = 1, P_SAC = 2 };

typedef struct {
    real_t rail;
    real_t area; /* below 0: shut, on the ramp that leads from or to the seat */
} Inputs;

/* Whatever laws in force change from sample to sample. */
typedef struct {
    Line line;
    real_t bias[2];   /* shares added to the flows through nozzle and seat */
    real_t nozzle[2]; /* rise of p_C while the needle is open, and for every unit of A_S */
} Model;

typedef struct {
    Inputs start;
    Inputs end;
} Interval;

extern const Model INJ_MODEL;

real_t inj_seat_opened(real_t lift);                   /* A_S of a lift [m] */
real_t inj_lift_of(real_t area);                       /* its inverse */
bool inj_is_at_rest(const real_t x[], Inputs u);       /* no flow through seat and nozzle */
void inj_flows(const real_t x[], Inputs u, const Model *m, real_t *q_h, real_t *q_s);
real_t inj_injection_rate(const real_t x[], Inputs u, const Model *m); /* m3/s */
real_t inj_softened(real_t pressure, const Line *line);                /* K_eff/K_L */
real_t inj_nozzle_law(real_t p_sac, real_t area, const real_t learned[2]);
real_t inj_nozzle_slope(real_t p_sac, real_t area, const real_t learned[2]);
real_t inj_seat_law(real_t difference, real_t area);
real_t inj_seat_slope(real_t difference, real_t area);
real_t inj_neuron(const real_t x[], Inputs u, uint32_t number);
void inj_change_line(Line *line, real_t stiffness, real_t inertance, real_t outflow, real_t loss);
void inj_empty_if_drained(real_t x[], const Interval *interval);

/* Of the line in use. */
void inj_line_at_rest(real_t x[], real_t pressure);
void inj_advance(real_t x[], const Interval *interval, const Model *m);
/* Pressure and flow as laws see them: of a lump in the middle of an interval with u there, along a pipe the mean flow. */
void inj_line_under_laws(const real_t x[], Inputs u, const Model *m, real_t *pressure, real_t *flow);
void inj_change_waves(Line *line, real_t stiffer, real_t lighter); /* what only a pipe has */

#endif
