/* FMI 2.0 for co-simulation: the standard's functions over the life cycle in life.c. The one file to compile; with
   -DFMI2_FUNCTION_PREFIX=name_ its functions are called name_fmi2..., for several units in one program. */
#define _GNU_SOURCE /* POSIX beside the standard library, for units that start a process */
#include "fmi2Functions.h"

#ifdef FMI2_FUNCTION_PREFIX /* which the header as it comes with fmpy leaves out of account */
#undef fmi2FullName
#define fmi2Joined(prefix, name) prefix##name
#define fmi2Prefixed(prefix, name) fmi2Joined(prefix, name)
#define fmi2FullName(name) fmi2Prefixed(FMI2_FUNCTION_PREFIX, name)
#endif

#include "life.c"

/* The unit and what its importer gave with it. */
typedef struct {
    Unit *unit;
    const fmi2CallbackFunctions *callbacks;
} Component;

/* The standard wants a message that goes with an error shown whatever loggingOn says. */
static void tell(Component *component) {
    const fmi2CallbackFunctions *callbacks = component->callbacks;
    if (callbacks && callbacks->logger)
        callbacks->logger(callbacks->componentEnvironment, component->unit->instance_name, fmi2Error, "logStatusError", "%s",
                          component->unit->message);
}

static fmi2Status done(Component *component, int well) {
    if (!well) tell(component);
    return well ? fmi2OK : fmi2Error;
}

static fmi2Status not_offered(Component *component, const char *what) {
    return done(component, refuse(component->unit, "This unit does not offer %s.", what));
}

#define UNIT(component) (((Component *)(component))->unit)

/* --- life cycle ----------------------------------------------------------------------------------------------- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

static int hexadecimal(char digit) {
    const char *digits = "0123456789abcdef", *place = digit ? strchr(digits, digit | 32) : NULL;
    return place ? (int)(place - digits) : -1;
}

/* The path of a file URI, in place. Some importers encode nothing: a % that no two digits follow stands for itself. */
static void path_of(char *uri) {
    char *from = uri, *to = uri;
    if (strncmp(from, "file:", 5) == 0) {
        from += 5;
        if (strncmp(from, "//", 2) == 0) {
            from += 2;
            if (strncmp(from, "localhost/", 10) == 0) from += 9;
        }
        if (from[0] == '/' && from[1] && from[2] == ':') from++; /* /C:/folder */
    }
    while (*from) {
        int high = *from == '%' ? hexadecimal(from[1]) : -1, low = high >= 0 ? hexadecimal(from[2]) : -1;
        *to++ = low >= 0 ? (char)(16 * high + low) : *from;
        from += low >= 0 ? 3 : 1;
    }
    *to = 0;
}

void fmi2FreeInstance(fmi2Component component) {
    if (!component) return;
    free_unit(UNIT(component));
    free(component);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging_on) {
    (void)visible;
    Component *component = calloc(1, sizeof *component);
    if (!component) return NULL;
    component->callbacks = callbacks;
    component->unit = new_unit(name, resources);
    if (!component->unit) return free(component), NULL;
    path_of(component->unit->resources);
    component->unit->logging_on = logging_on;
    if (type == fmi2CoSimulation && guid && strcmp(guid, UNIT_IDENTITY) == 0) return component;
    refuse(component->unit, type != fmi2CoSimulation ? "This unit is for co-simulation only."
                                                     : "The GUID is not the one of this binary, " UNIT_IDENTITY ".");
    tell(component);
    fmi2FreeInstance(component);
    return NULL;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[]) {
    (void)count, (void)categories;
    UNIT(c)->logging_on = on;
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start_time,
                               fmi2Boolean stop_defined, fmi2Real stop_time) {
    (void)tolerance_defined, (void)tolerance;
    return done(c, set_times(UNIT(c), start_time, stop_defined, stop_time));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return done(c, enter_initialization(UNIT(c))); }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return done(c, leave_initialization(UNIT(c))); }
fmi2Status fmi2Terminate(fmi2Component c) { return done(c, terminate(UNIT(c))); }

fmi2Status fmi2Reset(fmi2Component c) {
    reset(UNIT(c));
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real now, fmi2Real step, fmi2Boolean no_return) {
    (void)no_return;
    return done(c, step_unit(UNIT(c), now, step));
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    return done(c, refuse(UNIT(c), "A step is finished when the call returns, there is nothing to cancel."));
}

/* --- values ----------------------------------------------------------------------------------------------------- */

#define GET_AND_SET(NAME, TYPE, KIND)                                                                                  \
    fmi2Status fmi2Get##NAME(fmi2Component c, const fmi2ValueReference vr[], size_t n, TYPE values[]) {                \
        for (size_t i = 0; i < n; i++) {                                                                               \
            double value;                                                                                              \
            if (!get_value(UNIT(c), KIND, vr[i], &value)) return done(c, 0);                                           \
            values[i] = (TYPE)value;                                                                                   \
        }                                                                                                              \
        return fmi2OK;                                                                                                 \
    }                                                                                                                  \
    fmi2Status fmi2Set##NAME(fmi2Component c, const fmi2ValueReference vr[], size_t n, const TYPE values[]) {          \
        for (size_t i = 0; i < n; i++)                                                                                 \
            if (!set_value(UNIT(c), KIND, vr[i], (double)values[i])) return done(c, 0);                                \
        return fmi2OK;                                                                                                 \
    }

GET_AND_SET(Real, fmi2Real, REAL)
GET_AND_SET(Integer, fmi2Integer, INTEGER)
GET_AND_SET(Boolean, fmi2Boolean, BOOLEAN)

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String values[]) {
    for (size_t i = 0; i < n; i++)
        if (!get_text(UNIT(c), vr[i], &values[i])) return done(c, 0);
    return fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String values[]) {
    for (size_t i = 0; i < n; i++)
        if (!set_text(UNIT(c), vr[i], values[i])) return done(c, 0);
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real values[]) {
    for (size_t i = 0; i < n; i++)
        if (!get_rate(UNIT(c), vr[i], order[i], &values[i])) return done(c, 0);
    return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t many,
                                        const fmi2ValueReference knowns[], size_t count, const fmi2Real seeds[],
                                        fmi2Real changes[]) {
    return done(c, get_slopes(UNIT(c), unknowns, many, knowns, count, seeds, changes));
}

/* --- state ------------------------------------------------------------------------------------------------------ */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) { return done(c, save_state(UNIT(c), state)); }
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) { return done(c, restore_state(UNIT(c), state)); }

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    drop_saved(UNIT(c), state);
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    return done(c, serialized_size(UNIT(c), state, size));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    return done(c, serialize(UNIT(c), state, bytes, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    return done(c, deserialize(UNIT(c), bytes, size, state));
}

/* --- what the unit does not offer --------------------------------------------------------------------------------- */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real values[]) {
    (void)vr, (void)n, (void)order, (void)values;
    return not_offered(c, "input derivatives");
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)kind, (void)value;
    return not_offered(c, "asynchronous steps"), fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = UNIT(c)->state.time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = UNIT(c)->state.life == FAILED;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}
