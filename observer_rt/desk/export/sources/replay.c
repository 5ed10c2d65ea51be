/* Replays the reference runs beside these sources, and compares.
 *
 * replay observer|injector INPUTS.csv OUTPUTS.csv TOLERANCE: exit code 0 where all outputs agree, 1 where not, 2 where
 * the files cannot be read. Differences are relative to the largest value of a column. With no tolerance the outputs
 * are printed. For a PC: nothing of it belongs on a controller.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "injector.h"
#include "observer.h"

#define MOST_COLUMNS 16
#define LINE_LENGTH 1024

static int columns_of(char *line, double *values)
{
    int count = 0;
    char *end = line;
    char *at = line;
    while (count < MOST_COLUMNS) {
        values[count] = strtod(at, &end);
        if (end == at) {
            break;
        }
        ++count;
        if (*end != ',') {
            break;
        }
        at = end + 1;
    }
    return count;
}

static int observed(Observer *o, const double *in, double *out)
{
    const ObserverInput input = {(real_t)in[1], (real_t)in[2], (real_t)in[3]};
    ObserverOutput found;
    if (!inj_observer_step(o, &input, &found)) {
        return 0;
    }
    out[0] = found.is_valid ? 1.0 : 0.0;
    out[1] = found.is_open ? 1.0 : 0.0;
    out[2] = (double)found.injection_rate;
    out[3] = (double)found.innovation;
    out[4] = (double)found.observed.line_pressure;
    out[5] = (double)found.observed.line_flow;
    out[6] = (double)found.observed.sac_pressure;
    out[7] = (double)found.followed.line_pressure;
    out[8] = (double)found.followed.line_flow;
    out[9] = (double)found.followed.sac_pressure;
    return 10;
}

static int simulated(Injector *injector, int is_first, const double *in, double *out)
{
    InjectorOutput found;
    if (is_first) {
        inj_injector_init(injector, (real_t)in[1]);
    }
    inj_injector_step(injector, (real_t)in[1], (real_t)in[2], &found);
    out[0] = (double)found.injection_rate;
    out[1] = (double)found.recorded_line_pressure;
    return 2;
}

int main(int argc, char **argv)
{
    static Observer observer;
    static Injector injector;
    static char line[LINE_LENGTH];
    double in[MOST_COLUMNS], out[MOST_COLUMNS] = {0.0}, expected[MOST_COLUMNS];
    double furthest[MOST_COLUMNS] = {0.0}, largest[MOST_COLUMNS] = {0.0}, worst = 0.0;
    FILE *inputs = (argc > 2) ? fopen(argv[2], "r") : NULL;
    FILE *outputs = (argc > 3) ? fopen(argv[3], "r") : NULL;
    const int is_observer = (argc > 1) && (strcmp(argv[1], "observer") == 0);
    const int is_compared = argc > 4;
    int columns = 0;
    long rows = 0L, compared = 0L;
    if ((inputs == NULL) || (is_compared && (outputs == NULL))) {
        (void)fprintf(stderr, "replay observer|injector INPUTS.csv [OUTPUTS.csv TOLERANCE]\n");
        return 2;
    }
    inj_observer_init(&observer);
    (void)fgets(line, LINE_LENGTH, inputs); /* the names of the columns */
    if (is_compared) {
        (void)fgets(line, LINE_LENGTH, outputs);
    }
    while (fgets(line, LINE_LENGTH, inputs) != NULL) {
        int found;
        if (columns_of(line, in) < (is_observer ? 4 : 3)) {
            (void)fprintf(stderr, "%s: row %ld has too few columns\n", argv[2], rows + 1L);
            return 2;
        }
        found = is_observer ? observed(&observer, in, out) : simulated(&injector, rows == 0L, in, out);
        ++rows;
        if (found == 0) {
            continue;
        }
        columns = found;
        for (int k = 0; (k < columns) && !is_compared; ++k) {
            (void)printf("%.17g%c", out[k], (k + 1 < columns) ? ',' : '\n');
        }
        if (is_compared && (fgets(line, LINE_LENGTH, outputs) != NULL)) {
            if (columns_of(line, expected) != columns + 1) { /* time first */
                (void)fprintf(stderr, "%s: row %ld has other columns\n", argv[3], compared + 1L);
                return 2;
            }
            ++compared;
            for (int k = 0; k < columns; ++k) {
                const double far = fabs(out[k] - expected[k + 1]);
                furthest[k] = (far > furthest[k]) || (far != far) ? far : furthest[k];
                largest[k] = (fabs(expected[k + 1]) > largest[k]) ? fabs(expected[k + 1]) : largest[k];
            }
        }
    }
    if (!is_compared) {
        return 0;
    }
    for (int k = 0; k < columns; ++k) {
        const double relative = (largest[k] > 0.0) ? furthest[k] / largest[k] : furthest[k];
        (void)printf("%scolumn %d: %.3g\n", (k > 0) ? "" : "largest difference by column, relative\n", k + 1, relative);
        worst = ((relative > worst) || (relative != relative)) ? relative : worst;
    }
    (void)printf("%ld samples compared, largest relative difference %.3g\n", compared, worst);
    return ((compared > 0L) && (worst <= strtod(argv[4], NULL))) ? 0 : 1;
}
