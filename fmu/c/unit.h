/* What a unit written in C gives to the FMI layer in unit.c. The table of variables is generated (table.h). */
#ifndef UNIT_H
#define UNIT_H

#include "table.h"

#define MESSAGE_SIZE 512

typedef struct Unit Unit;

/* Each hook returns 1, or 0 after writing one sentence with refuse(). */
int unit_start(Unit *unit);            /* take the parameters, compute the outputs at unit->time */
int unit_step(Unit *unit, double end); /* go from unit->time to end and set the outputs */

int refuse(Unit *unit, const char *format, ...);

#include "model.h"

/* Everything a state must hold: it is copied as one block, so it has no pointers. */
typedef struct {
    int life;
    int stale; /* whether parameters or inputs were set since the outputs were computed */
    double time;
    double values[VARIABLE_COUNT]; /* Real, Integer and Boolean alike */
    Model model;
} State;

struct Unit {
    State state;
    char message[MESSAGE_SIZE];
    char *instance_name;
    int logging_on;
    const void *callbacks;
};

#endif
