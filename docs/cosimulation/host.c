/* A whole importer: loads an unpacked co-simulation unit, runs it and prints one of its outputs.
 *
 *     cc -o host host.c -ldl
 *     unzip BarrierSlidingC.fmu -d unit
 *     ./host unit barrier_displacement 0.01 4 speed=12 rise_ratio=0.2
 *
 * Arguments: folder of the unit, output, communication step [s], end [s], any Real parameters.
 * A unit that pythonfmu packed needs a Python in this process: start with LD_PRELOAD=/path/to/libpython3.X.so.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef void *Component;
typedef void Logger(void *environment, const char *name, int status, const char *category, const char *message, ...);

typedef struct {
    Logger *logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *step_finished, *environment;
} Callbacks;

static void show(void *environment, const char *name, int status, const char *category, const char *message, ...) {
    va_list arguments;
    (void)environment, (void)category;
    fprintf(stderr, "%s, status %d: ", name, status);
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

static char text[1 << 20], value[256]; /* modelDescription.xml, and an attribute of it */

static char *attribute(const char *from, const char *name) {
    char pattern[64];
    snprintf(pattern, sizeof pattern, " %s=\"%%255[^\"]", name);
    snprintf(value, sizeof value, " %s=\"", name);
    const char *at = from ? strstr(from, value) : NULL;
    return at && sscanf(at, pattern, value) == 1 ? value : NULL;
}

static unsigned reference(const char *variable) {
    char pattern[128];
    snprintf(pattern, sizeof pattern, " name=\"%s\" valueReference=", variable);
    char *found = attribute(strstr(text, pattern), "valueReference");
    if (!found) {
        fprintf(stderr, "There is no variable %s.\n", variable);
        exit(2);
    }
    return (unsigned)atoi(found);
}

static void *library;

static void *function(const char *name) {
    void *found = dlsym(library, name);
    if (!found) {
        fprintf(stderr, "The unit lacks %s.\n", name);
        exit(1);
    }
    return found;
}

static void check(int status, const char *call) {
    if (status <= 1) return; /* ok, warning */
    fprintf(stderr, "%s returned status %d.\n", call, status);
    exit(1);
}

int main(int count, char **arguments) {
    if (count < 5) {
        fprintf(stderr, "usage: host FOLDER OUTPUT STEP END [PARAMETER=VALUE]...\n");
        return 2;
    }
    char path[4096], guid[64], model[128], folder[2048];
    if (!realpath(arguments[1], folder)) return perror(arguments[1]), 2;
    snprintf(path, sizeof path, "%s/modelDescription.xml", folder);
    FILE *file = fopen(path, "r");
    if (!file || fread(text, 1, sizeof text - 1, file) == 0) return perror(path), 2;
    fclose(file);
    snprintf(guid, sizeof guid, "%s", attribute(text, "guid"));
    snprintf(model, sizeof model, "%s", attribute(text, "modelIdentifier"));
    snprintf(path, sizeof path, "%s/binaries/linux64/%s.so", folder, model);
    library = dlopen(path, RTLD_NOW);
    if (!library) return fprintf(stderr, "%s\n", dlerror()), 1;

    Component (*instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int);
    int (*set_real)(Component, const unsigned *, size_t, const double *) = function("fmi2SetReal");
    int (*get_real)(Component, const unsigned *, size_t, double *) = function("fmi2GetReal");
    int (*set_up)(Component, int, double, double, int, double) = function("fmi2SetupExperiment");
    int (*enter)(Component) = function("fmi2EnterInitializationMode");
    int (*leave)(Component) = function("fmi2ExitInitializationMode");
    int (*do_step)(Component, double, double, int) = function("fmi2DoStep");
    int (*terminate)(Component) = function("fmi2Terminate");
    void (*release)(Component) = function("fmi2FreeInstance");
    instantiate = function("fmi2Instantiate");

    Callbacks callbacks = {show, calloc, free, NULL, NULL};
    snprintf(path, sizeof path, "file://%s/resources", folder);
    Component unit = instantiate("unit", 1, guid, path, &callbacks, 0, 0);
    if (!unit) return fprintf(stderr, "The unit was not instantiated.\n"), 1;
    for (int i = 5; i < count; i++) {
        char *equals = strchr(arguments[i], '=');
        if (!equals) return fprintf(stderr, "%s is not PARAMETER=VALUE.\n", arguments[i]), 2;
        *equals = 0;
        unsigned which = reference(arguments[i]);
        double number = atof(equals + 1);
        check(set_real(unit, &which, 1, &number), "fmi2SetReal");
    }
    double step = atof(arguments[3]), end = atof(arguments[4]), result;
    check(set_up(unit, 0, 0, 0, 1, end), "fmi2SetupExperiment");
    check(enter(unit), "fmi2EnterInitializationMode");
    check(leave(unit), "fmi2ExitInitializationMode");
    unsigned output = reference(arguments[2]);
    for (long i = 0; i * step < end - step / 2; i++) check(do_step(unit, i * step, step, 1), "fmi2DoStep");
    check(get_real(unit, &output, 1, &result), "fmi2GetReal");
    printf("%.12g\n", result);
    check(terminate(unit), "fmi2Terminate");
    release(unit);
    return 0;
}
