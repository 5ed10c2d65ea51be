/* Answers input frames with themselves, whenever the observer would have a rate frame to send.
 *
 * usage: echo LINK INPUT_ID RATE_ID AHEAD
 *
 * AHEAD: samples that must be known beyond the last one of a rate frame.
 */
#include "frames.h"

enum { SAMPLES = 9, RATES = 28 };

int main(int argc, char **argv)
{
    if (argc != 5)
        return fprintf(stderr, "4 arguments, see the source\n"), 2;
    const canid_t input_id = (canid_t)atol(argv[2]), rate_id = (canid_t)atol(argv[3]);
    const int64_t ahead = atol(argv[4]);
    const int s = open_frames(argv[1], input_id);
    int64_t next = -1; /* index that the next answer begins with */
    struct canfd_frame f;
    puts("ready");
    fflush(stdout);
    while (recv(s, &f, sizeof f, 0) > 0) {
        if (f.can_id != input_id)
            continue;
        const int64_t index = get_index(&f);
        if (next < 0)
            next = (index + RATES - 1) / RATES * RATES;
        while (next + RATES + ahead <= index + SAMPLES) {
            f.can_id = rate_id;
            put_index(&f, (uint32_t)next);
            if (send(s, &f, sizeof f, 0) < 0)
                perror("send");
            next += RATES;
        }
    }
    return 0;
}
