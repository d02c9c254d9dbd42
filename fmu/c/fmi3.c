/* FMI 3.0 for co-simulation: the standard's functions over the life cycle in life.c. The one file to compile; with
   -DFMI3_FUNCTION_PREFIX=name_ its functions are called name_fmi3..., for several units in one program. */
#define _GNU_SOURCE /* POSIX beside the standard library, for units that start a process */
#include "fmi3Functions.h"

#include "life.c"

/* The unit and what its importer gave with it. */
typedef struct {
    Unit *unit;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Component;

/* The standard wants a message that goes with an error shown whatever loggingOn says. */
static void tell(Component *component) {
    if (component->log) component->log(component->environment, fmi3Error, "logStatusError", component->unit->message);
}

static fmi3Status done(Component *component, int well) {
    if (!well) tell(component);
    return well ? fmi3OK : fmi3Error;
}

static fmi3Status not_offered(Component *component, const char *what) {
    return done(component, refuse(component->unit, "This unit does not offer %s.", what));
}

#define UNIT(component) (((Component *)(component))->unit)

/* --- life cycle ----------------------------------------------------------------------------------------------- */

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging_on, fmi3Boolean event_mode_used, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t intermediates,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    (void)visible, (void)event_mode_used, (void)early_return, (void)intermediate, (void)intermediates, (void)update;
    Component *component = calloc(1, sizeof *component);
    if (!component) return NULL;
    component->environment = environment;
    component->log = log;
    component->unit = new_unit(name, resources);
    if (!component->unit) return free(component), NULL;
    component->unit->logging_on = logging_on;
    if (token && strcmp(token, UNIT_IDENTITY) == 0) return component;
    refuse(component->unit, "The instantiation token is not the one of this binary, " UNIT_IDENTITY ".");
    tell(component);
    fmi3FreeInstance(component);
    return NULL;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging_on, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging_on;
    if (log) log(environment, fmi3Error, "logStatusError", "This unit is for co-simulation only.");
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging_on,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
    (void)clock, (void)lock, (void)unlock;
    return fmi3InstantiateModelExchange(name, token, resources, visible, logging_on, environment, log);
}

void fmi3FreeInstance(fmi3Instance c) {
    if (!c) return;
    free_unit(UNIT(c));
    free(c);
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t count, const fmi3String categories[]) {
    (void)count, (void)categories;
    UNIT(c)->logging_on = on;
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start_time, fmi3Boolean stop_defined, fmi3Float64 stop_time) {
    (void)tolerance_defined, (void)tolerance;
    return done(c, set_times(UNIT(c), start_time, stop_defined, stop_time) && enter_initialization(UNIT(c)));
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return done(c, leave_initialization(UNIT(c))); }
fmi3Status fmi3Terminate(fmi3Instance c) { return done(c, terminate(UNIT(c))); }

fmi3Status fmi3Reset(fmi3Instance c) {
    reset(UNIT(c));
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 now, fmi3Float64 step, fmi3Boolean no_return,
                      fmi3Boolean *events_needed, fmi3Boolean *terminated, fmi3Boolean *early_return,
                      fmi3Float64 *last_time) {
    (void)no_return;
    int well = step_unit(UNIT(c), now, step);
    *events_needed = *terminated = *early_return = false;
    *last_time = UNIT(c)->state.time;
    return done(c, well);
}

/* --- values ----------------------------------------------------------------------------------------------------- */

static int alike(Unit *unit, size_t references, size_t values) {
    return references == values || refuse(unit, "There are %lu value references, but %lu values.", (unsigned long)references,
                                          (unsigned long)values);
}

/* The independent variable stands behind all others. */
static int get_number(Unit *unit, int kind, unsigned reference, double *value) {
    if (kind != REAL || reference != VARIABLE_COUNT) return get_value(unit, kind, reference, value);
    *value = unit->state.time;
    return 1;
}

#define GET_AND_SET(NAME, TYPE, KIND)                                                                                  \
    fmi3Status fmi3Get##NAME(fmi3Instance c, const fmi3ValueReference vr[], size_t n, TYPE values[], size_t m) {       \
        if (!alike(UNIT(c), n, m)) return done(c, 0);                                                                  \
        for (size_t i = 0; i < n; i++) {                                                                               \
            double value;                                                                                              \
            if (!get_number(UNIT(c), KIND, vr[i], &value)) return done(c, 0);                                          \
            values[i] = (TYPE)value;                                                                                   \
        }                                                                                                              \
        return fmi3OK;                                                                                                 \
    }                                                                                                                  \
    fmi3Status fmi3Set##NAME(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const TYPE values[], size_t m) { \
        if (!alike(UNIT(c), n, m)) return done(c, 0);                                                                  \
        for (size_t i = 0; i < n; i++)                                                                                 \
            if (!set_value(UNIT(c), KIND, vr[i], (double)values[i])) return done(c, 0);                                \
        return fmi3OK;                                                                                                 \
    }

GET_AND_SET(Float64, fmi3Float64, REAL)
GET_AND_SET(Int64, fmi3Int64, INTEGER) /* enumerations */
GET_AND_SET(Boolean, fmi3Boolean, BOOLEAN)

fmi3Status fmi3GetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3String values[], size_t m) {
    if (!alike(UNIT(c), n, m)) return done(c, 0);
    for (size_t i = 0; i < n; i++)
        if (!get_text(UNIT(c), vr[i], &values[i])) return done(c, 0);
    return fmi3OK;
}

fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3String values[], size_t m) {
    if (!alike(UNIT(c), n, m)) return done(c, 0);
    for (size_t i = 0; i < n; i++)
        if (!set_text(UNIT(c), vr[i], values[i])) return done(c, 0);
    return fmi3OK;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t m) {
    if (!alike(UNIT(c), n, m)) return done(c, 0);
    for (size_t i = 0; i < n; i++)
        if (!get_rate(UNIT(c), vr[i], orders[i], &values[i])) return done(c, 0);
    return fmi3OK;
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t many,
                                        const fmi3ValueReference knowns[], size_t count, const fmi3Float64 seeds[],
                                        size_t seed_count, fmi3Float64 changes[], size_t change_count) {
    if (!alike(UNIT(c), count, seed_count) || !alike(UNIT(c), many, change_count)) return done(c, 0);
    return done(c, get_slopes(UNIT(c), unknowns, many, knowns, count, seeds, changes));
}

#define NO_VARIABLES(NAME)                                                                                             \
    fmi3Status fmi3Get##NAME(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3##NAME values[], size_t m) { \
        (void)vr, (void)values, (void)m;                                                                               \
        return n ? not_offered(c, "variables of the type " #NAME) : fmi3OK;                                            \
    }                                                                                                                  \
    fmi3Status fmi3Set##NAME(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3##NAME values[],       \
                             size_t m) {                                                                               \
        (void)vr, (void)values, (void)m;                                                                               \
        return n ? not_offered(c, "variables of the type " #NAME) : fmi3OK;                                            \
    }

NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(UInt64)

/* --- state ------------------------------------------------------------------------------------------------------ */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) { return done(c, save_state(UNIT(c), state)); }
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) { return done(c, restore_state(UNIT(c), state)); }

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
    drop_saved(UNIT(c), state);
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    return done(c, serialized_size(UNIT(c), state, size));
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    return done(c, serialize(UNIT(c), state, (char *)bytes, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    return done(c, deserialize(UNIT(c), (const char *)bytes, size, state));
}

/* --- what the unit does not offer --------------------------------------------------------------------------------- */

#define NOT_OFFERED(NAME, PARAMETERS, UNUSED, WHAT)                                                                    \
    fmi3Status NAME PARAMETERS {                                                                                       \
        UNUSED;                                                                                                        \
        return not_offered(c, WHAT);                                                                                   \
    }

typedef fmi3ValueReference Reference;
typedef fmi3Float64 Real;

NOT_OFFERED(fmi3GetBinary,
            (fmi3Instance c, const Reference vr[], size_t n, size_t sizes[], fmi3Binary values[], size_t m),
            ((void)vr, (void)n, (void)sizes, (void)values, (void)m), "binary variables")
NOT_OFFERED(fmi3SetBinary,
            (fmi3Instance c, const Reference vr[], size_t n, const size_t sizes[], const fmi3Binary values[], size_t m),
            ((void)vr, (void)n, (void)sizes, (void)values, (void)m), "binary variables")
NOT_OFFERED(fmi3GetClock, (fmi3Instance c, const Reference vr[], size_t n, fmi3Clock values[]),
            ((void)vr, (void)n, (void)values), "clocks")
NOT_OFFERED(fmi3SetClock, (fmi3Instance c, const Reference vr[], size_t n, const fmi3Clock values[]),
            ((void)vr, (void)n, (void)values), "clocks")
NOT_OFFERED(fmi3GetIntervalDecimal,
            (fmi3Instance c, const Reference vr[], size_t n, Real intervals[], fmi3IntervalQualifier qualifiers[]),
            ((void)vr, (void)n, (void)intervals, (void)qualifiers), "clocks")
NOT_OFFERED(fmi3GetIntervalFraction,
            (fmi3Instance c, const Reference vr[], size_t n, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
             fmi3IntervalQualifier qualifiers[]),
            ((void)vr, (void)n, (void)counters, (void)resolutions, (void)qualifiers), "clocks")
NOT_OFFERED(fmi3GetShiftDecimal, (fmi3Instance c, const Reference vr[], size_t n, Real shifts[]),
            ((void)vr, (void)n, (void)shifts), "clocks")
NOT_OFFERED(fmi3GetShiftFraction,
            (fmi3Instance c, const Reference vr[], size_t n, fmi3UInt64 counters[], fmi3UInt64 resolutions[]),
            ((void)vr, (void)n, (void)counters, (void)resolutions), "clocks")
NOT_OFFERED(fmi3SetIntervalDecimal, (fmi3Instance c, const Reference vr[], size_t n, const Real intervals[]),
            ((void)vr, (void)n, (void)intervals), "clocks")
NOT_OFFERED(fmi3SetIntervalFraction,
            (fmi3Instance c, const Reference vr[], size_t n, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]),
            ((void)vr, (void)n, (void)counters, (void)resolutions), "clocks")
NOT_OFFERED(fmi3SetShiftDecimal, (fmi3Instance c, const Reference vr[], size_t n, const Real shifts[]),
            ((void)vr, (void)n, (void)shifts), "clocks")
NOT_OFFERED(fmi3SetShiftFraction,
            (fmi3Instance c, const Reference vr[], size_t n, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]),
            ((void)vr, (void)n, (void)counters, (void)resolutions), "clocks")
NOT_OFFERED(fmi3ActivateModelPartition, (fmi3Instance c, Reference clock, Real time), ((void)clock, (void)time), "clocks")
NOT_OFFERED(fmi3GetNumberOfVariableDependencies, (fmi3Instance c, Reference vr, size_t *n), ((void)vr, (void)n),
            "dependencies of elements")
NOT_OFFERED(fmi3GetVariableDependencies,
            (fmi3Instance c, Reference dependent, size_t elements[], Reference independents[], size_t others[],
             fmi3DependencyKind kinds[], size_t n),
            ((void)dependent, (void)elements, (void)independents, (void)others, (void)kinds, (void)n),
            "dependencies of elements")
NOT_OFFERED(fmi3GetAdjointDerivative,
            (fmi3Instance c, const Reference u[], size_t nu, const Reference k[], size_t nk, const Real seed[],
             size_t seeds, Real sensitivity[], size_t sensitivities),
            ((void)u, (void)nu, (void)k, (void)nk, (void)seed, (void)seeds, (void)sensitivity, (void)sensitivities),
            "adjoint derivatives")
NOT_OFFERED(fmi3EnterConfigurationMode, (fmi3Instance c), (void)0, "a configuration mode")
NOT_OFFERED(fmi3ExitConfigurationMode, (fmi3Instance c), (void)0, "a configuration mode")
NOT_OFFERED(fmi3EnterEventMode, (fmi3Instance c), (void)0, "an event mode")
NOT_OFFERED(fmi3EnterStepMode, (fmi3Instance c), (void)0, "an event mode")
NOT_OFFERED(fmi3EvaluateDiscreteStates, (fmi3Instance c), (void)0, "an event mode")
NOT_OFFERED(fmi3UpdateDiscreteStates,
            (fmi3Instance c, fmi3Boolean *need, fmi3Boolean *end, fmi3Boolean *nominals, fmi3Boolean *states,
             fmi3Boolean *defined, Real *next),
            ((void)need, (void)end, (void)nominals, (void)states, (void)defined, (void)next), "an event mode")
NOT_OFFERED(fmi3EnterContinuousTimeMode, (fmi3Instance c), (void)0, "model exchange")
NOT_OFFERED(fmi3CompletedIntegratorStep, (fmi3Instance c, fmi3Boolean no_return, fmi3Boolean *event, fmi3Boolean *end),
            ((void)no_return, (void)event, (void)end), "model exchange")
NOT_OFFERED(fmi3SetTime, (fmi3Instance c, Real time), ((void)time), "model exchange")
NOT_OFFERED(fmi3SetContinuousStates, (fmi3Instance c, const Real states[], size_t n), ((void)states, (void)n),
            "model exchange")
NOT_OFFERED(fmi3GetContinuousStateDerivatives, (fmi3Instance c, Real values[], size_t n), ((void)values, (void)n),
            "model exchange")
NOT_OFFERED(fmi3GetEventIndicators, (fmi3Instance c, Real values[], size_t n), ((void)values, (void)n), "model exchange")
NOT_OFFERED(fmi3GetContinuousStates, (fmi3Instance c, Real values[], size_t n), ((void)values, (void)n), "model exchange")
NOT_OFFERED(fmi3GetNominalsOfContinuousStates, (fmi3Instance c, Real values[], size_t n), ((void)values, (void)n),
            "model exchange")
NOT_OFFERED(fmi3GetNumberOfEventIndicators, (fmi3Instance c, size_t *n), ((void)n), "model exchange")
NOT_OFFERED(fmi3GetNumberOfContinuousStates, (fmi3Instance c, size_t *n), ((void)n), "model exchange")
