/* FMI 2.0 co-simulation layer over a table of variables and a model. */
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "unit.h"

enum { SETUP, INITIALIZATION, STEPPING, FAILED, TERMINATED };

static const char *const LIFE_NAMES[] = {"setup", "initialization", "stepping", "failed", "terminated"};
static const char STATE_MARK[] = UNIT_GUID;

/* Largest difference [s] between the importer's communication point and the unit's own time. */
#define TIME_TOLERANCE 1e-6

int refuse(Unit *unit, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(unit->message, MESSAGE_SIZE, format, arguments);
    va_end(arguments);
    return 0;
}

/* The standard wants a message that goes with an error shown whatever loggingOn says; only Discard depends on it. */
static fmi2Status tell(Unit *unit, fmi2Status status) {
    const fmi2CallbackFunctions *callbacks = unit->callbacks;
    if (callbacks && callbacks->logger && (status != fmi2Discard || unit->logging_on))
        callbacks->logger(callbacks->componentEnvironment, unit->instance_name, status,
                          status == fmi2Discard ? "logStatusDiscard" : "logStatusError", "%s", unit->message);
    return status;
}

static int check(Unit *unit, int reference) {
    const Entry *entry = &TABLE[reference];
    double value = unit->state.values[reference];
    if (entry->kind == INTEGER) {
        if (value >= entry->minimum && value <= entry->maximum) return 1;
        return refuse(unit, "%s is %d, it must be one of %s.", entry->name, (int)value, entry->range);
    }
    if (entry->kind != REAL) return 1;
    if (isfinite(value) && value <= entry->maximum && (entry->open_minimum ? value > entry->minimum : value >= entry->minimum))
        return 1;
    return refuse(unit, "%s is %g%s, it must be a finite number in %s.", entry->name, value, entry->unit, entry->range);
}

static void undefine_outputs(Unit *unit) {
    for (int i = 0; i < VARIABLE_COUNT; i++)
        if (TABLE[i].causality == OUTPUT) unit->state.values[i] = TABLE[i].kind == REAL ? NAN : TABLE[i].start;
}

static int begin(Unit *unit) {
    for (int i = 0; i < VARIABLE_COUNT; i++)
        if (TABLE[i].causality != OUTPUT && !check(unit, i)) return 0;
    if (!unit_start(unit)) return 0;
    unit->state.stale = 0;
    return 1;
}

static void set_up(Unit *unit) {
    memset(&unit->state, 0, sizeof unit->state);
    unit->state.life = SETUP;
    unit->state.stale = 1;
    for (int i = 0; i < VARIABLE_COUNT; i++) unit->state.values[i] = TABLE[i].start;
    undefine_outputs(unit);
}

/* --- life cycle ----------------------------------------------------------------------------------------------- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging_on) {
    (void)resources;
    (void)visible;
    Unit *unit = calloc(1, sizeof *unit);
    if (!unit) return NULL;
    unit->callbacks = callbacks;
    unit->logging_on = logging_on;
    unit->instance_name = calloc(1, (name ? strlen(name) : 0) + 1);
    if (unit->instance_name && name) strcpy(unit->instance_name, name);
    if (!unit->instance_name || type != fmi2CoSimulation || !guid || strcmp(guid, UNIT_GUID) != 0) {
        refuse(unit, type != fmi2CoSimulation ? "This unit is for co-simulation only."
                                              : "The GUID is not the one of this binary, " UNIT_GUID ".");
        tell(unit, fmi2Error);
        free(unit->instance_name);
        free(unit);
        return NULL;
    }
    set_up(unit);
    return unit;
}

void fmi2FreeInstance(fmi2Component component) {
    Unit *unit = component;
    if (!unit) return;
    free(unit->instance_name);
    free(unit);
}

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t count, const fmi2String categories[]) {
    (void)count;
    (void)categories;
    ((Unit *)component)->logging_on = on;
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start_time, fmi2Boolean stop_defined, fmi2Real stop_time) {
    (void)tolerance_defined;
    (void)tolerance;
    (void)stop_defined;
    (void)stop_time;
    Unit *unit = component;
    unit->state.time = start_time;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component) {
    ((Unit *)component)->state.life = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component) {
    Unit *unit = component;
    if (unit->state.stale && !begin(unit)) return tell(unit, fmi2Error);
    unit->state.life = STEPPING;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component component) {
    ((Unit *)component)->state.life = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component) {
    set_up(component);
    return fmi2OK;
}

static int take_step(Unit *unit, double now, double step) {
    State *state = &unit->state;
    double end = now + step;
    if (state->life != STEPPING)
        return refuse(unit, "A step was asked of a unit in its %s stage.", LIFE_NAMES[state->life]);
    if (!(fabs(now - state->time) <= TIME_TOLERANCE * fmax(1.0, fabs(state->time))))
        return refuse(unit, "The step starts at %g s, but the unit stands at %g s: restore a state to go back.", now,
                      state->time);
    if (!(end >= state->time - TIME_TOLERANCE))
        return refuse(unit, "The step is %g s long, it must be a number of at least 0 s.", step);
    for (int i = 0; i < VARIABLE_COUNT; i++)
        if (TABLE[i].causality == INPUT && !check(unit, i)) return 0;
    if (!unit_step(unit, end)) return 0;
    state->time = end;
    return 1;
}

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real now, fmi2Real step, fmi2Boolean no_return) {
    (void)no_return;
    Unit *unit = component;
    if (take_step(unit, now, step)) return fmi2OK;
    unit->state.life = FAILED;
    undefine_outputs(unit); /* some masters go on after a failed step: leave nothing that looks like a result */
    return tell(unit, fmi2Error);
}

fmi2Status fmi2CancelStep(fmi2Component component) {
    refuse(component, "A step is finished when the call returns, there is nothing to cancel.");
    return tell(component, fmi2Error);
}

/* --- values ----------------------------------------------------------------------------------------------------- */

static fmi2Status get(Unit *unit, int kind, size_t count, const fmi2ValueReference references[], double values[]) {
    if (unit->state.stale && unit->state.life == INITIALIZATION && !begin(unit)) undefine_outputs(unit);
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= VARIABLE_COUNT || TABLE[references[i]].kind != kind) {
            refuse(unit, "Value reference %u is not a %s variable of this unit.", references[i], KIND_NAMES[kind]);
            return tell(unit, fmi2Error);
        }
        values[i] = unit->state.values[references[i]];
    }
    return fmi2OK;
}

static fmi2Status set(Unit *unit, int kind, fmi2ValueReference reference, double value) {
    if (reference >= VARIABLE_COUNT || TABLE[reference].kind != kind) {
        refuse(unit, "Value reference %u is not a %s variable of this unit.", reference, KIND_NAMES[kind]);
        return tell(unit, fmi2Error);
    }
    const Entry *entry = &TABLE[reference];
    if (entry->causality == OUTPUT) {
        refuse(unit, "%s is an output, it cannot be set.", entry->name);
        return tell(unit, fmi2Error);
    }
    if (entry->causality == PARAMETER && unit->state.life > INITIALIZATION) {
        refuse(unit, "%s is a fixed parameter, it cannot be set after initialization.", entry->name);
        return tell(unit, fmi2Error);
    }
    unit->state.values[reference] = value;
    unit->state.stale = 1;
    return fmi2OK;
}

#define GET_AND_SET(NAME, TYPE, KIND)                                                                                  \
    fmi2Status fmi2Get##NAME(fmi2Component c, const fmi2ValueReference vr[], size_t n, TYPE values[]) {                \
        for (size_t i = 0; i < n; i++) {                                                                               \
            double value;                                                                                              \
            fmi2Status status = get(c, KIND, 1, vr + i, &value);                                                       \
            if (status != fmi2OK) return status;                                                                       \
            values[i] = (TYPE)value;                                                                                   \
        }                                                                                                              \
        return fmi2OK;                                                                                                 \
    }                                                                                                                  \
    fmi2Status fmi2Set##NAME(fmi2Component c, const fmi2ValueReference vr[], size_t n, const TYPE values[]) {          \
        for (size_t i = 0; i < n; i++) {                                                                               \
            fmi2Status status = set(c, KIND, vr[i], (double)values[i]);                                                \
            if (status != fmi2OK) return status;                                                                       \
        }                                                                                                              \
        return fmi2OK;                                                                                                 \
    }

GET_AND_SET(Real, fmi2Real, REAL)
GET_AND_SET(Integer, fmi2Integer, INTEGER)
GET_AND_SET(Boolean, fmi2Boolean, BOOLEAN)

static fmi2Status no_strings(Unit *unit, size_t count) {
    if (!count) return fmi2OK;
    refuse(unit, "This unit has no String variables.");
    return tell(unit, fmi2Error);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String values[]) {
    (void)vr;
    (void)values;
    return no_strings(c, n);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String values[]) {
    (void)vr;
    (void)values;
    return no_strings(c, n);
}

/* --- state ------------------------------------------------------------------------------------------------------ */

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state) {
    if (!*state) *state = malloc(sizeof(State));
    if (!*state) return fmi2Error;
    memcpy(*state, &((Unit *)component)->state, sizeof(State));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state) {
    memcpy(&((Unit *)component)->state, state, sizeof(State));
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state) {
    (void)component;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size) {
    (void)component;
    (void)state;
    *size = sizeof STATE_MARK + sizeof(State);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    if (size < sizeof STATE_MARK + sizeof(State)) {
        refuse(component, "A state needs %u bytes.", (unsigned)(sizeof STATE_MARK + sizeof(State)));
        return tell(component, fmi2Error);
    }
    memcpy(bytes, STATE_MARK, sizeof STATE_MARK);
    memcpy(bytes + sizeof STATE_MARK, state, sizeof(State));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    if (size < sizeof STATE_MARK + sizeof(State) || memcmp(bytes, STATE_MARK, sizeof STATE_MARK) != 0) {
        refuse(component, "The bytes are not a state of this unit.");
        return tell(component, fmi2Error);
    }
    if (!*state) *state = malloc(sizeof(State));
    if (!*state) return fmi2Error;
    memcpy(*state, bytes + sizeof STATE_MARK, sizeof(State));
    return fmi2OK;
}

/* --- what the unit does not offer --------------------------------------------------------------------------------- */

static fmi2Status not_offered(Unit *unit, const char *what) {
    refuse(unit, "This unit does not offer %s.", what);
    return tell(unit, fmi2Error);
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference u[], size_t nu,
                                        const fmi2ValueReference k[], size_t nk, const fmi2Real dk[], fmi2Real du[]) {
    (void)u, (void)nu, (void)k, (void)nk, (void)dk, (void)du;
    return not_offered(c, "directional derivatives");
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real values[]) {
    (void)vr, (void)n, (void)order, (void)values;
    return not_offered(c, "input derivatives");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real values[]) {
    (void)vr, (void)n, (void)order, (void)values;
    return not_offered(c, "output derivatives");
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)kind, (void)value;
    return not_offered(c, "asynchronous steps"), fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Real *value) {
    Unit *unit = component;
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = unit->state.time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Boolean *value) {
    Unit *unit = component;
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = unit->state.life == FAILED;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}
