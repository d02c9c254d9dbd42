/* The material point simulation, run by a worker process in the Python that has the simulator: the C twin of
   debris_flow.py and worker_process.py. Nothing of Python is loaded here. */
#include <locale.h>

#define START_TIME_LIMIT 60.0 /* [s] in which a worker must say that it is there */
#define PATH_SIZE (2 * TEXT_SIZE)
#define LOST "The state was lost with the simulator's process that kept it."
#define PATIENCE 5.0          /* [s] in which a worker ends when its input does */

static double seconds(void);
static int launch(Unit *unit, char *const arguments[]);
static int transmit(Unit *unit, const char *request, const char *text, size_t size);
static int receive(Unit *unit, const char *request, double time_limit);
static void end_worker(Own *worker, double patience);

/* --- lines of JSON -------------------------------------------------------------------------------------------------- */

typedef struct {
    char *text;
    size_t size, room;
} Line;

static void put(Line *line, const char *text, size_t size) {
    if (line->size + size + 1 > line->room) {
        size_t room = 2 * (line->size + size + 1);
        char *more = realloc(line->text, room);
        if (!more) return; /* the worker will call what is left no request */
        line->text = more;
        line->room = room;
    }
    memcpy(line->text + line->size, text, size);
    line->text[line->size += size] = 0;
}

static void put_text(Line *line, const char *text) { put(line, text, strlen(text)); }

/* The bytes of a character in UTF-8, 0 if it is none. */
static int length_in_utf8(const unsigned char *text) {
    int length = text[0] < 0x80 ? 1 : text[0] >= 0xc2 && text[0] < 0xe0 ? 2 : (text[0] & 0xf0) == 0xe0 ? 3
               : text[0] >= 0xf0 && text[0] < 0xf5 ? 4 : 0;
    for (int i = 1; i < length; i++)
        if ((text[i] & 0xc0) != 0x80) return 0;
    return length;
}

static void put_string(Line *line, const char *text) {
    put_text(line, "\"");
    while (*text) {
        char escaped[8];
        unsigned char byte = (unsigned char)*text;
        int length = length_in_utf8((const unsigned char *)text);
        /* A byte that is no text, in the name of a file, goes the way that Python gives it: a lone surrogate. */
        if (length == 0) snprintf(escaped, sizeof escaped, "\\udc%02x", byte);
        else snprintf(escaped, sizeof escaped, byte == '"' || byte == '\\' ? "\\%c" : "\\u%04x", byte);
        if (length == 0 || byte < 0x20 || byte == '"' || byte == '\\') put_text(line, escaped);
        else put(line, text, (size_t)length);
        text += length ? length : 1;
    }
    put_text(line, "\"");
}

/* The host may have set a locale with a comma in its numbers. */
static void put_number(Line *line, double value) {
    char text[40];
    snprintf(text, sizeof text, "%.17g", value);
    char *comma = strchr(text, *localeconv()->decimal_point);
    if (comma) *comma = '.';
    put_text(line, text);
}

static void put_named(Line *line, const char *name) {
    put_text(line, ", ");
    put_string(line, name);
    put_text(line, ": ");
}

static const char *skip_string(const char *place) {
    for (place++; *place && *place != '"'; place++)
        if (*place == '\\' && place[1]) place++;
    return *place ? place + 1 : place;
}

/* The value of a name in a line that holds one flat object, NULL if it is not there. */
static const char *value_of(const char *line, const char *name) {
    const char *place = strchr(line, '{');
    size_t length = strlen(name);
    while (place && *place) {
        place += strspn(place, "{, \t\r\n");
        if (*place != '"') return NULL;
        int found = strncmp(place + 1, name, length) == 0 && place[1 + length] == '"';
        place = skip_string(place);
        place += strspn(place, ": ");
        if (found) return place;
        place = *place == '"' ? skip_string(place) : place + strcspn(place, ",}");
        if (*place == '}') return NULL;
    }
    return NULL;
}

static int number_of(const char *line, const char *name, double *number) {
    char text[40] = "", *end;
    const char *value = value_of(line, name);
    if (!value) return 0;
    for (int i = 0; i < 39 && value[i] && strchr("+-.0123456789eE", value[i]); i++)
        text[i] = value[i] == '.' ? *localeconv()->decimal_point : value[i];
    *number = strtod(text, &end);
    return end != text && *end == 0;
}

static unsigned code_unit(const char *digits) {
    char four[5] = "";
    strncpy(four, digits, 4);
    return (unsigned)strtoul(four, NULL, 16);
}

/* The text of a name, as UTF-8; cut off where there is no more room. */
static int text_of(const char *line, const char *name, char *text, size_t room) {
    const char *value = value_of(line, name);
    if (!value || *value != '"') return 0;
    size_t size = 0;
    for (value++; *value && *value != '"' && size + 5 < room; value++) {
        if (*value != '\\') {
            text[size++] = *value;
            continue;
        }
        unsigned code = (unsigned char)*++value;
        if (!*value) break;
        if (*value == 'n' || *value == 't' || *value == 'r' || *value == 'b' || *value == 'f') code = ' ';
        if (*value == 'u' && strlen(value) > 4) {
            code = code_unit(value + 1);
            value += 4;
            if (code >= 0xd800 && code < 0xdc00 && value[1] == '\\' && value[2] == 'u' && strlen(value) > 6) {
                code = 0x10000 + ((code - 0xd800) << 10) + (code_unit(value + 3) - 0xdc00);
                value += 6;
            }
        }
        if (code >= 0xdc80 && code <= 0xdcff) text[size++] = (char)(code - 0xdc00); /* a byte of the name of a file */
        else if (code < 0x80) text[size++] = (char)code;
        else {
            int more = code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
            text[size++] = (char)((0xf0 << (3 - more)) | (code >> 6 * more));
            while (more--) text[size++] = (char)(0x80 | (code >> 6 * more & 0x3f));
        }
    }
    text[size] = 0;
    return 1;
}

/* --- requests --------------------------------------------------------------------------------------------------- */

static Line request_for(const char *request) {
    Line line = {0};
    put_text(&line, "{\"request\": ");
    put_string(&line, request);
    return line;
}

/* Send a request, which is released, and wait for its answer. */
static int ask(Unit *unit, const char *request, Line *line, double time_limit) {
    put_text(line, "}\n");
    int sent = unit->own.running && line->text ? transmit(unit, request, line->text, line->size)
                                               : refuse(unit, "The simulator's process has ended.");
    free(line->text);
    if (!sent || !receive(unit, request, time_limit)) return 0;
    char fault[MESSAGE_SIZE];
    if (text_of(unit->own.answer, "error", fault, sizeof fault)) return refuse(unit, "%s", fault);
    return 1;
}

static double time_limit_of(const Unit *unit) { return unit->state.values[REPLY_TIME_LIMIT]; }

static int ask_about(Unit *unit, const char *request, const Kept *kept) {
    Line line = request_for(request);
    put_named(&line, "key");
    put_number(&line, kept->key);
    return ask(unit, request, &line, time_limit_of(unit));
}

/* --- the worker ------------------------------------------------------------------------------------------------- */

static void in_resources(const Unit *unit, const char *name, char path[PATH_SIZE]) {
    size_t length = strlen(unit->resources);
    int separated = length && unit->resources[length - 1] == '/';
    snprintf(path, PATH_SIZE, "%s%s%s", unit->resources, separated ? "" : "/", name);
}

static int is_file(const char *path) {
    FILE *file = fopen(path, "rb");
    int found = file && fgetc(file) != EOF; /* a folder opens, but cannot be read */
    if (file) fclose(file);
    return found;
}

/* Which Python, the worker's module, and where that is found: the environment variable, or the record of the build. */
static int find_interpreter(Unit *unit, char *record, size_t room, char *arguments[], int most) {
    const char *chosen = getenv(INTERPRETER_VARIABLE);
    char path[PATH_SIZE];
    record[0] = 0;
    if (chosen && *chosen) {
        if (!is_file(chosen))
            return refuse(unit, INTERPRETER_VARIABLE " is %s, it must be the path of a Python interpreter.", chosen);
        snprintf(record, room, "%s\n" INSTALLED_WORKER "\n", chosen);
    } else {
        in_resources(unit, RECORD, path);
        FILE *file = fopen(path, "rb");
        if (file) {
            record[fread(record, 1, room - 1, file)] = 0;
            fclose(file);
        }
    }
    int count = 0;
    for (char *line = record; *line && count < most; count++) {
        arguments[count] = line;
        line += strcspn(line, "\n");
        if (*line) *line++ = 0;
    }
    if (!count || !is_file(arguments[0]))
        return refuse(unit, "There is no Python for the simulator at %s: set " INTERPRETER_VARIABLE
                            " to the Python of the environment that has warp-mpm-impact.",
                      count ? arguments[0] : "any recorded place");
    return count;
}

static void keep_states(Unit *unit);

static void close_worker(Unit *unit, double patience) {
    Own *worker = &unit->own;
    if (!worker->running) return;
    keep_states(unit);
    end_worker(worker, patience);
    worker->running = 0;
    free(worker->answer);
    worker->answer = NULL;
    worker->held = worker->room = 0;
}

static int start_worker(Unit *unit) {
    enum { MOST = 16 };
    char record[4 * TEXT_SIZE], *found[MOST], *arguments[MOST + 4];
    int count = find_interpreter(unit, record, sizeof record, found, MOST);
    if (!count) return 0;
    arguments[0] = found[0];
    arguments[1] = "-P"; /* the host's working folder is no place to import from */
    arguments[2] = "-c";
    arguments[3] = LAUNCH;
    for (int i = 1; i < count; i++) arguments[3 + i] = found[i];
    arguments[3 + count] = NULL;
    if (!launch(unit, arguments)) return 0;
    unit->own.running = 1;
    double protocol = 0;
    int greeted = receive(unit, "start", START_TIME_LIMIT);
    if (greeted && number_of(unit->own.answer, "protocol", &protocol) && protocol == PROTOCOL) return 1;
    if (greeted)
        refuse(unit, "The simulator at %s speaks version %g of the protocol, this archive version %d: install the release "
                     "of warp-mpm-impact that built the archive.", found[0], protocol, PROTOCOL);
    else if (strstr(unit->message, "No module named")) {
        char absent[MESSAGE_SIZE];
        int length = snprintf(absent, sizeof absent, "%s", strstr(unit->message, "No module named"));
        if (absent[length - 1] == '.') absent[length - 1] = 0;
        refuse(unit, "The Python %s has no warp-mpm-impact (%s): install it there, or set " INTERPRETER_VARIABLE
                     " to the Python of an environment that has it.", found[0], absent);
    }
    close_worker(unit, 0);
    return 0;
}

/* The worker with the scenario that the parameters name; the present one if it has that. */
static int open_worker(Unit *unit) {
    const State *state = &unit->state;
    const char *chosen = state->texts[TABLE[SCENARIO_FILE].text];
    Line line = request_for("open");
    put_named(&line, "scenario");
    char path[PATH_SIZE];
    in_resources(unit, SCENARIO, path);
    put_string(&line, *chosen ? chosen : path);
    put_named(&line, "device");
    put_string(&line, state->texts[TABLE[DEVICE].text]);
    put_named(&line, "spacing");
    if (state->values[SPACING] > 0) put_number(&line, state->values[SPACING]);
    else put_text(&line, "null");
    put_named(&line, "driven");
    int driven = state->values[BARRIER_MOTION] == MOTION_DRIVEN;
    put_text(&line, driven ? "true" : "false");
    if (!line.text) return refuse(unit, "There is no memory for a request.");
    if (line.size >= SETTINGS_SIZE) return free(line.text), refuse(unit, "scenario_file is too long.");
    if (unit->own.running && unit->own.process && strcmp(line.text, unit->own.settings) == 0) return free(line.text), 1;
    close_worker(unit, PATIENCE);
    if (!start_worker(unit)) return free(line.text), 0;
    strcpy(unit->own.settings, line.text);
    unit->own.driven = driven;
    if (ask(unit, "open", &line, time_limit_of(unit))) return 1; /* compiles the kernels too, so that no step has to */
    close_worker(unit, 0);
    return 0;
}

/* The outputs that take all material points. */
static int take_counts(Unit *unit) {
    double *values = unit->state.values;
    return number_of(unit->own.answer, "overtopped_volume", &values[OVERTOPPED_VOLUME]) &&
           number_of(unit->own.answer, "gauge_depth", &values[GAUGE_DEPTH]);
}

/* Outputs from the last answer, by their names in it. */
static int take(Unit *unit) {
    double *values = unit->state.values;
    const char *answer = unit->own.answer;
    for (int i = 0; i < VARIABLE_COUNT; i++) {
        if (TABLE[i].causality != OUTPUT || TABLE[i].kind != REAL || i == OVERTOPPED_VOLUME || i == GAUGE_DEPTH || i == TIME_RATIO) continue;
        if (!number_of(answer, TABLE[i].name, &values[i]))
            return refuse(unit, "The simulator's process sent no %s.", TABLE[i].name);
    }
    unit->state.model.counts_due = !take_counts(unit);
    if (unit->state.model.counts_due) values[OVERTOPPED_VOLUME] = values[GAUGE_DEPTH] = 0; /* until they are asked for */
    unit->state.texts[TABLE[MESSAGE].text][0] = 0;
    return 1;
}

static int unit_start(Unit *unit) {
    Model *model = &unit->state.model;
    *model = (Model){0};
    model->start_time = unit->state.time;
    unit->state.values[TIME_RATIO] = 0;
    Line line = request_for("sample");
    if (!open_worker(unit)) return free(line.text), 0;
    return ask(unit, "sample", &line, time_limit_of(unit)) && take(unit);
}

static int unit_step(Unit *unit, double end) {
    Model *model = &unit->state.model;
    double *values = unit->state.values, velocity = values[BARRIER_VELOCITY_INPUT];
    int driven = unit->own.driven;
    if (!driven && velocity != 0)
        return refuse(unit, "barrier_velocity_input is %g m/s, it must be 0 m/s unless barrier_motion is 2 (driven).", velocity);
    Line line = request_for("step");
    put_named(&line, "until");
    put_number(&line, end - model->start_time);
    put_named(&line, "barrier_velocity");
    if (driven) put_number(&line, velocity);
    else put_text(&line, "null");
    put_named(&line, "external_force");
    put_number(&line, values[EXTERNAL_FORCE]);
    put_named(&line, "gauge");
    if (model->counts_wanted) put_number(&line, values[GAUGE_POSITION]);
    else put_text(&line, "null");
    double started = seconds();
    if (!ask(unit, "step", &line, time_limit_of(unit))) return 0;
    model->wall_time += seconds() - started;
    values[TIME_RATIO] = model->wall_time > 0 ? (end - model->start_time) / model->wall_time : 0;
    return take(unit);
}

static int unit_rate(Unit *unit, int reference, double *rate) {
    (void)reference, (void)rate;
    return refuse(unit, "This unit does not offer derivatives.");
}

static int unit_slope(Unit *unit, const double *by, double *slope) {
    (void)by, (void)slope;
    return refuse(unit, "This unit does not offer directional derivatives.");
}

/* Counted for an importer that asks, and from then on within each step. */
static int unit_read(Unit *unit, int reference) {
    Model *model = &unit->state.model;
    if ((reference != OVERTOPPED_VOLUME && reference != GAUGE_DEPTH) || !model->counts_due) return 1;
    model->counts_due = 0;
    model->counts_wanted = 1;
    Line line = request_for("count");
    put_named(&line, "gauge");
    put_number(&line, unit->state.values[GAUGE_POSITION]);
    return ask(unit, "count", &line, time_limit_of(unit)) && take_counts(unit);
}

static void unit_close(Unit *unit) { close_worker(unit, PATIENCE); }

/* --- states: kept by the worker, and fetched from it when it ends ------------------------------------------------- */

static int fetch(Unit *unit, Kept *kept) {
    if (kept->data || !kept->key) return 1;
    if (!ask_about(unit, "export_state", kept)) return 0;
    const char *value = value_of(unit->own.answer, "data");
    if (!value || *value != '"') return refuse(unit, "The simulator's process sent no state.");
    kept->size = (size_t)(skip_string(value) - value) - 2; /* base64: nothing in it is escaped */
    kept->data = malloc(kept->size + 1);
    if (!kept->data) return refuse(unit, "There is no memory for a state.");
    memcpy(kept->data, value + 1, kept->size);
    kept->data[kept->size] = 0;
    return 1;
}

static void keep_states(Unit *unit) {
    char message[MESSAGE_SIZE];
    memcpy(message, unit->message, MESSAGE_SIZE); /* of why the worker ends */
    for (Kept *kept = unit->own.states; kept; kept = kept->next) {
        fetch(unit, kept);
        kept->key = 0;
    }
    unit->own.states = NULL;
    memcpy(unit->message, message, MESSAGE_SIZE);
}

static int unit_save(Unit *unit, Kept *kept) {
    double key;
    if (unit->state.life != STEPPING) return 1; /* nothing was simulated that a start would not bring back */
    Line line = request_for("save_state");
    if (!ask(unit, "save_state", &line, time_limit_of(unit))) return 0;
    if (!number_of(unit->own.answer, "key", &key)) return refuse(unit, "The simulator's process sent no state.");
    kept->key = (int)key;
    kept->next = unit->own.states;
    unit->own.states = kept;
    return 1;
}

static int kept_here(const Unit *unit, const Kept *kept) {
    const Kept *other = unit->own.states;
    while (other && other != kept) other = other->next;
    return other != NULL;
}

static int unit_restore(Unit *unit, Kept *kept) {
    int here = kept_here(unit, kept);
    if (!here && kept->key) return refuse(unit, "The state is of another instance: serialize it there.");
    if (!here && !kept->data) {
        if (unit->state.life != STEPPING) { /* a simulation that has gone on since does not belong to it */
            close_worker(unit, PATIENCE);
            unit->state.stale = 1;
            return 1;
        }
        return refuse(unit, LOST);
    }
    if (!open_worker(unit)) return 0;
    unit->state.model.counts_due = 1;
    if (kept_here(unit, kept)) return ask_about(unit, "restore_state", kept);
    if (!kept->data) return refuse(unit, LOST); /* with a worker that had ended before it was asked */
    Line line = request_for("import_state");
    put_named(&line, "data");
    put_string(&line, kept->data);
    return ask(unit, "import_state", &line, time_limit_of(unit));
}

static void unit_drop(Unit *unit, Kept *kept) {
    for (Kept **place = &unit->own.states; *place; place = &(*place)->next) {
        if (*place != kept) continue;
        *place = kept->next;
        if (unit->own.running) ask_about(unit, "drop_state", kept);
        break;
    }
    free(kept->data);
}

static int unit_export(Unit *unit, Kept *kept, const char **data, size_t *size) {
    if (kept->key && !kept->data && !kept_here(unit, kept))
        return refuse(unit, "The state is of another instance.");
    if (!fetch(unit, kept)) return 0;
    *data = kept->data ? kept->data : "";
    *size = kept->size;
    return 1;
}

static int unit_import(Unit *unit, Kept *kept, const char *data, size_t size) {
    if (!size) return 1;
    kept->data = malloc(size + 1);
    if (!kept->data) return refuse(unit, "There is no memory for a state.");
    memcpy(kept->data, data, size);
    kept->data[size] = 0;
    kept->size = size;
    return 1;
}

#include "process.c"
