/* State of the simulator's unit; included by unit.h. Names as in debris_flow.py and worker_process.py. */
#ifndef DEBRIS_FLOW_H
#define DEBRIS_FLOW_H

#define SETTINGS_SIZE (2 * TEXT_SIZE)

typedef struct {
    double start_time, wall_time; /* wall time that the steps took [s] */
    int counts_due, counts_wanted; /* of what takes all material points */
} Model;

/* What a state holds beside: the worker keeps it under a number, or, if that worker has ended, its text is here. */
typedef struct Kept {
    int key;
    char *data;
    size_t size;
    struct Kept *next; /* the other states that this worker keeps */
} Kept;

/* The worker's process, and what was asked of it when it started. */
typedef struct {
    int running;
    int process, channel; /* its number, and the socket that is its standard input and output */
    void *errors;         /* a FILE, its standard error */
    char settings[SETTINGS_SIZE];
    int driven;
    char *answer; /* the last line that it sent; `held` bytes of `room` are in use */
    size_t held, room;
    Kept *states;
} Own;

#endif
