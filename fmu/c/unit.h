/* What a model written in C and the life cycle of a unit know of each other. The table of variables is generated
   (table.h). Each binary is compiled from one file, fmi2.c or fmi3.c, which includes all others: their names stay its
   own, so that several units may be linked into one program. */
#ifndef UNIT_H
#define UNIT_H

#include <stddef.h>

#include "table.h"

#define MESSAGE_SIZE 1024

typedef struct Unit Unit;

/* The stages of a unit's life. */
enum { SETUP, INITIALIZATION, STEPPING, FAILED, TERMINATED };

/* For a model whose Model is all that it remembers: nothing belongs to a unit, or to a state, beside it. */
#define PLAIN_STATE                                                                                                    \
    typedef char Own;                                                                                                  \
    typedef char Kept;
#define NOTHING_BEYOND_THE_STATE                                                                                       \
    static int unit_read(Unit *unit, int reference) { return (void)unit, (void)reference, 1; }                         \
    static void unit_close(Unit *unit) { (void)unit; }                                                                 \
    static int unit_save(Unit *unit, Kept *kept) { return (void)unit, (void)kept, 1; }                                 \
    static int unit_restore(Unit *unit, Kept *kept) { return (void)unit, (void)kept, 1; }                              \
    static void unit_drop(Unit *unit, Kept *kept) { (void)unit, (void)kept; }                                          \
    static int unit_export(Unit *unit, Kept *kept, const char **data, size_t *size) {                                  \
        return (void)unit, (void)kept, *data = "", *size = 0, 1;                                                       \
    }                                                                                                                  \
    static int unit_import(Unit *unit, Kept *kept, const char *data, size_t size) {                                    \
        return (void)unit, (void)kept, (void)data, size == 0;                                                          \
    }

/* Gives the types Model, which is copied as a block and so has no pointers, Own and Kept. */
#include MODEL_HEADER

/* Everything of a unit that a state must hold. */
typedef struct {
    int life;
    int stale; /* whether parameters or inputs were set since the outputs were computed */
    int stop_defined;
    double time, stop_time;
    double values[VARIABLE_COUNT]; /* Real, Integer and Boolean alike */
    char texts[TEXT_COUNT + 1][TEXT_SIZE];
    Model model;
} State;

struct Unit {
    State state;
    Own own; /* what the operating system must have back */
    char message[MESSAGE_SIZE]; /* what was refused last, in one sentence */
    char failure[MESSAGE_SIZE]; /* why the last step failed */
    char *instance_name;
    char *resources; /* path of the archive's resources, or empty */
    int logging_on;
};

/* Hooks of a model. Each that returns an int returns 1, or 0 after writing one sentence with refuse(). */
static int unit_start(Unit *unit);                              /* take the parameters, compute the outputs at state.time */
static int unit_step(Unit *unit, double end);                   /* go from state.time to end and set the outputs */
static int unit_rate(Unit *unit, int reference, double *rate);  /* derivative in time of an output */
/* How all outputs change with what acted during the last step; `by` has the changes of inputs and tunable parameters. */
static int unit_slope(Unit *unit, const double *by, double *slope);
static int unit_read(Unit *unit, int reference);                /* make an output ready that is computed when asked for */
static void unit_close(Unit *unit);                             /* give back what the operating system must have */
static int unit_save(Unit *unit, Kept *kept);                   /* what a state holds beside State */
static int unit_restore(Unit *unit, Kept *kept);                /* state.model is back already */
static void unit_drop(Unit *unit, Kept *kept);
static int unit_export(Unit *unit, Kept *kept, const char **data, size_t *size); /* data belongs to kept */
static int unit_import(Unit *unit, Kept *kept, const char *data, size_t size);

static int refuse(Unit *unit, const char *format, ...);

#endif
