/* The life cycle that all units share, whatever the version of the standard. Functions return 1, or 0 with a message. */
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "unit.h"

#include MODEL_SOURCE

static const char *const LIFE_NAMES[] = {"setup", "initialization", "stepping", "failed", "terminated"};

/* Largest difference [s] between the importer's communication point and the unit's own time. */
#define TIME_TOLERANCE 1e-6

static int refuse(Unit *unit, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(unit->message, MESSAGE_SIZE, format, arguments);
    va_end(arguments);
    return 0;
}

static int out_of_order(Unit *unit, const char *call) {
    return refuse(unit, "%s is out of order in the %s stage of a unit.", call, LIFE_NAMES[unit->state.life]);
}

static int check(Unit *unit, int reference) {
    const Entry *entry = &TABLE[reference];
    double value = unit->state.values[reference];
    if (entry->kind == INTEGER) {
        if (value >= entry->minimum && value <= entry->maximum) return 1;
        return refuse(unit, "%s is %.0f, it must be one of %s.", entry->name, value, entry->range);
    }
    if (entry->kind != REAL) return 1;
    if (isfinite(value) && value <= entry->maximum && (entry->open_minimum ? value > entry->minimum : value >= entry->minimum))
        return 1;
    return refuse(unit, "%s is %g%s, it must be a finite number in %s.", entry->name, value, entry->unit, entry->range);
}

/* Some masters go on after a failed step: leave nothing that looks like a result. */
static void undefine_outputs(Unit *unit) {
    for (int i = 0; i < VARIABLE_COUNT; i++)
        if (TABLE[i].causality == OUTPUT) unit->state.values[i] = TABLE[i].kind == REAL ? NAN : TABLE[i].start;
}

static int check_outputs(Unit *unit) {
    for (int i = 0; i < VARIABLE_COUNT; i++)
        if (TABLE[i].causality == OUTPUT && TABLE[i].kind == REAL && !isfinite(unit->state.values[i]))
            return refuse(unit, "%s came out as %g: the parameters or inputs are beyond what can be computed with.",
                          TABLE[i].name, unit->state.values[i]);
    return 1;
}

static int begin(Unit *unit) {
    for (int i = 0; i < VARIABLE_COUNT; i++)
        if (TABLE[i].causality != OUTPUT && !check(unit, i)) return 0;
    if (!unit_start(unit) || !check_outputs(unit)) return 0;
    unit->state.stale = 0;
    return 1;
}

static void set_up(Unit *unit) {
    memset(&unit->state, 0, sizeof unit->state);
    unit->failure[0] = 0;
    unit->state.life = SETUP;
    unit->state.stale = 1;
    for (int i = 0; i < VARIABLE_COUNT; i++) {
        unit->state.values[i] = TABLE[i].start;
        if (TABLE[i].kind == STRING) strcpy(unit->state.texts[TABLE[i].text], TABLE[i].start_text);
    }
    undefine_outputs(unit);
}

static char *copied(const char *text) {
    char *copy = calloc(1, (text ? strlen(text) : 0) + 1);
    return copy && text ? strcpy(copy, text) : copy;
}

static Unit *new_unit(const char *name, const char *resources) {
    Unit *unit = calloc(1, sizeof *unit);
    if (!unit) return NULL;
    unit->instance_name = copied(name);
    unit->resources = copied(resources);
    set_up(unit);
    if (unit->instance_name && unit->resources) return unit;
    free(unit->instance_name);
    free(unit->resources);
    return free(unit), NULL;
}

static void free_unit(Unit *unit) {
    unit_close(unit);
    free(unit->instance_name);
    free(unit->resources);
    free(unit);
}

/* --- life cycle ------------------------------------------------------------------------------------------------- */

static int set_times(Unit *unit, double start, int stop_defined, double stop) {
    State *state = &unit->state;
    if (state->life != SETUP) return out_of_order(unit, "Setting the times of the experiment");
    if (!isfinite(start)) return refuse(unit, "The start time is %g s, it must be a finite number.", start);
    if (stop_defined && !(stop >= start && isfinite(stop)))
        return refuse(unit, "The stop time is %g s, it must be a finite number of at least the start time, %g s.", stop, start);
    state->time = start;
    state->stop_defined = stop_defined != 0;
    state->stop_time = stop_defined ? stop : 0;
    return 1;
}

static int enter_initialization(Unit *unit) {
    if (unit->state.life != SETUP) return out_of_order(unit, "Entering the initialization");
    unit->state.life = INITIALIZATION;
    return 1;
}

static int leave_initialization(Unit *unit) {
    if (unit->state.life != INITIALIZATION) return out_of_order(unit, "Leaving the initialization");
    if (unit->state.stale && !begin(unit)) return undefine_outputs(unit), 0;
    unit->state.life = STEPPING;
    return 1;
}

static int terminate(Unit *unit) {
    if (unit->state.life != STEPPING && unit->state.life != FAILED) return out_of_order(unit, "Terminating");
    unit->state.life = TERMINATED;
    unit_close(unit);
    return 1;
}

static void reset(Unit *unit) {
    unit_close(unit);
    set_up(unit);
}

static int take_step(Unit *unit, double now, double step) {
    State *state = &unit->state;
    double end = fmax(now + step, state->time);
    if (state->life == FAILED) return refuse(unit, "%s", unit->failure[0] ? unit->failure : "A step failed before.");
    if (state->life != STEPPING) return out_of_order(unit, "A step");
    if (!(fabs(now - state->time) <= TIME_TOLERANCE * fmax(1.0, fabs(state->time))))
        return refuse(unit, "The step starts at %g s, but the unit stands at %g s: restore a state to go back.", now,
                      state->time);
    if (!(step >= 0 && isfinite(step) && isfinite(end)))
        return refuse(unit, "The step is %g s long, it must be a finite number of at least 0 s.", step);
    if (state->stop_defined && end > state->stop_time + TIME_TOLERANCE * fmax(1.0, fabs(state->stop_time)))
        return refuse(unit, "The step ends at %g s, it must end by the stop time that was set, %g s.", end, state->stop_time);
    for (int i = 0; i < VARIABLE_COUNT; i++)
        if ((TABLE[i].causality == INPUT || TABLE[i].tunable) && !check(unit, i)) return 0;
    if (!unit_step(unit, end) || !check_outputs(unit)) return 0;
    state->time = end;
    return 1;
}

static void fail(Unit *unit) {
    unit->state.life = FAILED;
    undefine_outputs(unit);
    memcpy(unit->failure, unit->message, MESSAGE_SIZE);
#ifdef HAS_MESSAGE
    snprintf(unit->state.texts[TABLE[MESSAGE].text], TEXT_SIZE, "%s", unit->message);
#endif
}

static int step_unit(Unit *unit, double now, double step) {
    if (take_step(unit, now, step)) return 1;
    if (unit->state.life == STEPPING) fail(unit);
    return 0;
}

/* --- values ------------------------------------------------------------------------------------------------------- */

static int known(Unit *unit, int kind, unsigned reference) {
    if (reference < VARIABLE_COUNT && TABLE[reference].kind == kind) return 1;
    return refuse(unit, "Value reference %u is not a %s variable of this unit.", reference, KIND_NAMES[kind]);
}

static int readable(Unit *unit, int kind, unsigned reference) {
    if (!known(unit, kind, reference)) return 0;
    if (unit->state.stale && unit->state.life == INITIALIZATION && !begin(unit)) undefine_outputs(unit);
    int computed = unit->state.life == INITIALIZATION || unit->state.life == STEPPING;
    if (computed && TABLE[reference].causality == OUTPUT && !unit_read(unit, (int)reference)) fail(unit);
    return 1; /* after a failure it reads as no number */
}

static int writable(Unit *unit, int kind, unsigned reference) {
    if (!known(unit, kind, reference)) return 0;
    const Entry *entry = &TABLE[reference];
    if (entry->causality == OUTPUT) return refuse(unit, "%s is an output, it cannot be set.", entry->name);
    if (unit->state.life == TERMINATED) return out_of_order(unit, "Setting a variable");
    if (entry->causality == PARAMETER && !entry->tunable && unit->state.life > INITIALIZATION)
        return refuse(unit, "%s is a fixed parameter, it cannot be set after initialization.", entry->name);
    return 1;
}

static int get_value(Unit *unit, int kind, unsigned reference, double *value) {
    if (!readable(unit, kind, reference)) return 0;
    *value = unit->state.values[reference];
    return 1;
}

static int set_value(Unit *unit, int kind, unsigned reference, double value) {
    if (!writable(unit, kind, reference)) return 0;
    unit->state.values[reference] = value;
    unit->state.stale = 1;
    return 1;
}

static int get_text(Unit *unit, unsigned reference, const char **text) {
    if (!readable(unit, STRING, reference)) return 0;
    *text = unit->state.texts[TABLE[reference].text];
    return 1;
}

static int set_text(Unit *unit, unsigned reference, const char *text) {
    if (!writable(unit, STRING, reference)) return 0;
    if (!text || strlen(text) >= TEXT_SIZE)
        return refuse(unit, "%s must be a text of less than %d bytes.", TABLE[reference].name, TEXT_SIZE);
    strcpy(unit->state.texts[TABLE[reference].text], text);
    unit->state.stale = 1;
    return 1;
}

static int get_rate(Unit *unit, unsigned reference, int order, double *rate) {
    if (!known(unit, REAL, reference)) return 0;
    if (order < 1 || order > OUTPUT_DERIVATIVES || TABLE[reference].causality != OUTPUT)
        return refuse(unit, "This unit does not offer derivatives of order %d of %s.", order, TABLE[reference].name);
    if (unit->state.life != STEPPING) return out_of_order(unit, "Reading a derivative");
    return unit_rate(unit, (int)reference, rate);
}

/* Change of the unknowns, outputs all of them, per change of the knowns: inputs and tunable parameters. */
static int get_slopes(Unit *unit, const unsigned unknowns[], size_t many, const unsigned knowns[], size_t count,
                      const double seeds[], double changes[]) {
    double by[VARIABLE_COUNT] = {0}, slope[VARIABLE_COUNT] = {0};
    for (size_t i = 0; i < many; i++) {
        if (!known(unit, REAL, unknowns[i])) return 0;
        if (TABLE[unknowns[i]].causality != OUTPUT)
            return refuse(unit, "This unit does not offer derivatives of %s, which is no output.", TABLE[unknowns[i]].name);
    }
    for (size_t i = 0; i < count; i++) {
        if (!known(unit, REAL, knowns[i])) return 0;
        if (TABLE[knowns[i]].causality != INPUT && !TABLE[knowns[i]].tunable)
            return refuse(unit, "This unit does not offer derivatives with respect to %s, which is neither an input nor a "
                                "tunable parameter.", TABLE[knowns[i]].name);
        if (!isfinite(seeds[i])) return refuse(unit, "The change of %s is no number.", TABLE[knowns[i]].name);
        by[knowns[i]] += seeds[i];
    }
    if (unit->state.life != STEPPING && unit->state.life != INITIALIZATION) return out_of_order(unit, "Reading a derivative");
    if (unit->state.life == INITIALIZATION && unit->state.stale && !begin(unit)) return undefine_outputs(unit), 0;
    if (!unit_slope(unit, by, slope)) return 0;
    for (size_t i = 0; i < many; i++) changes[i] = slope[unknowns[i]];
    return 1;
}

/* --- state -------------------------------------------------------------------------------------------------------- */

typedef struct {
    State state;
    Kept kept;
} Saved;

static const char STATE_MARK[] = UNIT_IDENTITY;
#define CHECKSUM_SIZE sizeof(uint64_t)
#define HEAD_SIZE (sizeof STATE_MARK + CHECKSUM_SIZE)

static Saved *new_saved(Unit *unit) {
    Saved *saved = calloc(1, sizeof *saved);
    if (!saved) refuse(unit, "There is no memory for a state.");
    return saved;
}

static void drop_saved(Unit *unit, void **place) {
    if (!*place) return;
    unit_drop(unit, &((Saved *)*place)->kept);
    free(*place);
    *place = NULL;
}

/* The importer may hand in an earlier state to be replaced. */
static int save_state(Unit *unit, void **place) {
    Saved *saved = new_saved(unit);
    if (!saved) return 0;
    memcpy(&saved->state, &unit->state, sizeof(State));
    if (!unit_save(unit, &saved->kept)) return free(saved), 0;
    drop_saved(unit, place);
    *place = saved;
    return 1;
}

static int restore_state(Unit *unit, Saved *saved) {
    if (!saved) return refuse(unit, "There is no state to restore.");
    memcpy(&unit->state, &saved->state, sizeof(State));
    return unit_restore(unit, &saved->kept);
}

/* FNV-1a. Bytes that were changed or cut off must not become a state. */
static uint64_t checksum(const char *bytes, size_t size, uint64_t sum) {
    for (size_t i = 0; i < size; i++) sum = (sum ^ (unsigned char)bytes[i]) * 1099511628211u;
    return sum;
}
#define CHECKSUM_START 14695981039346656037u

static int serialized_size(Unit *unit, Saved *saved, size_t *size) {
    const char *data;
    size_t more;
    if (!saved) return refuse(unit, "There is no state to serialize.");
    if (!unit_export(unit, &saved->kept, &data, &more)) return 0;
    *size = HEAD_SIZE + sizeof(State) + more;
    return 1;
}

static int serialize(Unit *unit, Saved *saved, char *bytes, size_t size) {
    const char *data;
    size_t needed, more;
    if (!serialized_size(unit, saved, &needed) || !unit_export(unit, &saved->kept, &data, &more)) return 0;
    if (size < needed) return refuse(unit, "The state needs %lu bytes.", (unsigned long)needed);
    uint64_t sum = checksum((const char *)&saved->state, sizeof(State), CHECKSUM_START);
    sum = checksum(data, more, sum);
    memcpy(bytes, STATE_MARK, sizeof STATE_MARK);
    memcpy(bytes + sizeof STATE_MARK, &sum, CHECKSUM_SIZE);
    memcpy(bytes + HEAD_SIZE, &saved->state, sizeof(State));
    memcpy(bytes + HEAD_SIZE + sizeof(State), data, more);
    return 1;
}

static int deserialize(Unit *unit, const char *bytes, size_t size, void **place) {
    uint64_t sum;
    int right = bytes && size >= HEAD_SIZE + sizeof(State) && memcmp(bytes, STATE_MARK, sizeof STATE_MARK) == 0;
    if (right) {
        memcpy(&sum, bytes + sizeof STATE_MARK, CHECKSUM_SIZE);
        right = sum == checksum(bytes + HEAD_SIZE, size - HEAD_SIZE, CHECKSUM_START);
    }
    if (!right) return refuse(unit, "The bytes are not a state of this unit, or are damaged.");
    Saved *saved = new_saved(unit);
    if (!saved) return 0;
    memcpy(&saved->state, bytes + HEAD_SIZE, sizeof(State));
    if (!unit_import(unit, &saved->kept, bytes + HEAD_SIZE + sizeof(State), size - HEAD_SIZE - sizeof(State)))
        return free(saved), 0;
    drop_saved(unit, place);
    *place = saved;
    return 1;
}
