/* The worker's process and the line to it, as POSIX systems have them. Included by debris_flow.c. */
#ifdef _WIN32

static double seconds(void) { return 0; }
static int launch(Unit *unit, char *const arguments[]) {
    (void)arguments;
    return refuse(unit, "This unit starts its simulator on Linux and macOS; on Windows take DebrisFlow.fmu.");
}
static int transmit(Unit *unit, const char *request, const char *text, size_t size) {
    return (void)unit, (void)request, (void)text, (void)size, 0;
}
static int receive(Unit *unit, const char *request, double time_limit) {
    return (void)unit, (void)request, (void)time_limit, 0;
}
static void end_worker(Own *worker, double patience) { (void)worker, (void)patience; }

#else

#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#ifdef __APPLE__
#include <crt_externs.h>
#define ENVIRONMENT (*_NSGetEnviron())
#else
extern char **environ;
#define ENVIRONMENT environ
#endif

#ifndef MSG_NOSIGNAL
#define MSG_NOSIGNAL 0 /* macOS: SO_NOSIGPIPE below */
#endif

/* What a host sets for its own Python, or preloads into it, must not reach the worker's. */
static const char *const HOST_ONLY[] = {"LD_PRELOAD=", "PYTHONHOME=", "PYTHONPATH=", "PYTHONEXECUTABLE=",
                                        "PYTHONSTARTUP=", "__PYVENV_LAUNCHER__="};

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static char **environment_of_worker(void) {
    size_t count = 0, kept = 0;
    while (ENVIRONMENT[count]) count++;
    char **kept_variables = calloc(count + 1, sizeof *kept_variables);
    for (size_t i = 0; kept_variables && i < count; i++) {
        int meant_for_host = 0;
        for (size_t k = 0; k < sizeof HOST_ONLY / sizeof *HOST_ONLY; k++)
            if (strncmp(ENVIRONMENT[i], HOST_ONLY[k], strlen(HOST_ONLY[k])) == 0) meant_for_host = 1;
        if (!meant_for_host) kept_variables[kept++] = ENVIRONMENT[i];
    }
    return kept_variables;
}

static int launch(Unit *unit, char *const arguments[]) {
    Own *worker = &unit->own;
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends))
        return refuse(unit, "There is no line to the simulator's process: %s.", strerror(errno));
    /* Another process that this host starts must not hold the line open. */
    fcntl(ends[0], F_SETFD, FD_CLOEXEC);
    fcntl(ends[1], F_SETFD, FD_CLOEXEC);
#ifdef SO_NOSIGPIPE
    setsockopt(ends[0], SOL_SOCKET, SO_NOSIGPIPE, &(int){1}, sizeof(int));
#endif
    FILE *errors = tmpfile();
    char **environment = environment_of_worker();
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    sigset_t none;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], 0);
    posix_spawn_file_actions_adddup2(&actions, ends[1], 1);
    if (errors) posix_spawn_file_actions_adddup2(&actions, fileno(errors), 2);
    posix_spawnattr_init(&attributes);
    sigemptyset(&none);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
    pid_t process;
    int fault = posix_spawn(&process, arguments[0], &actions, &attributes, arguments, environment);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    free(environment);
    close(ends[1]);
    if (fault) {
        close(ends[0]);
        if (errors) fclose(errors);
        return refuse(unit, "The simulator's Python %s does not start (%s): set " INTERPRETER_VARIABLE
                            " to the Python of the environment that has warp-mpm-impact.", arguments[0], strerror(fault));
    }
    worker->process = process;
    worker->channel = ends[0];
    worker->errors = errors;
    return 1;
}

/* The last line that is not blank, without its full stop, of what the worker wrote to its standard error. */
static void last_words(FILE *errors, char *words, size_t room) {
    char line[MESSAGE_SIZE / 2];
    words[0] = 0;
    if (!errors) return;
    rewind(errors);
    while (fgets(line, sizeof line, errors)) {
        size_t end = strlen(line);
        while (end && isspace((unsigned char)line[end - 1])) line[--end] = 0;
        if (end && line[end - 1] == '.') line[end - 1] = 0;
        if (end) snprintf(words, room, ": %s", line);
    }
}

/* Say how the worker ended; it has, or is about to. */
static int obituary(Unit *unit, const char *request) {
    Own *worker = &unit->own;
    int status = 0;
    char words[MESSAGE_SIZE / 2];
    while (waitpid(worker->process, &status, 0) < 0 && errno == EINTR) {
    }
    worker->process = 0;
    last_words(worker->errors, words, sizeof words);
    if (WIFSIGNALED(status))
        refuse(unit, "The simulator's process ended by signal %d during the request '%s'%s.", WTERMSIG(status), request, words);
    else
        refuse(unit, "The simulator's process ended with exit code %d during the request '%s'%s.", WEXITSTATUS(status),
               request, words);
    return 0;
}

static int transmit(Unit *unit, const char *request, const char *text, size_t size) {
    if (!unit->own.process) return refuse(unit, "The simulator's process has ended.");
    while (size) {
        ssize_t sent = send(unit->own.channel, text, size, MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR) continue;
        if (sent < 0) return obituary(unit, request);
        text += sent;
        size -= (size_t)sent;
    }
    return 1;
}

/* Wait for one line, which is then in `answer`. */
static int receive(Unit *unit, const char *request, double time_limit) {
    Own *worker = &unit->own;
    double end = seconds() + time_limit;
    worker->held = 0;
    for (;;) {
        if (worker->room - worker->held < 1 << 16) {
            size_t room = 2 * worker->room + (1 << 17);
            char *more = realloc(worker->answer, room);
            if (!more) return refuse(unit, "There is no memory for an answer.");
            worker->answer = more;
            worker->room = room;
        }
        double left = end - seconds();
        struct pollfd waiting = {worker->channel, POLLIN, 0};
        int ready = poll(&waiting, 1, left > 2e6 ? 2000000000 : left > 0 ? (int)(1000 * left) + 1 : 0);
        if (ready < 0 && errno == EINTR) continue;
        if (ready == 0) {
            kill(worker->process, SIGKILL);
            obituary(unit, request);
            return refuse(unit, "The simulator did not answer the request '%s' within %g s and was ended; reply_time_limit "
                                "sets how long to wait.", request, time_limit);
        }
        ssize_t got = recv(worker->channel, worker->answer + worker->held, worker->room - worker->held - 1, 0);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return obituary(unit, request);
        worker->held += (size_t)got;
        worker->answer[worker->held] = 0;
        if (worker->answer[worker->held - 1] == '\n') break; /* it answers with one line, and then waits */
    }
    if (worker->answer[0] == '{') return 1;
    refuse(unit, "The simulator's process sent what is no answer to '%s': %.80s", request, worker->answer);
    kill(worker->process, SIGKILL);
    return 0;
}

/* Let the worker end by itself, which it does when its line is closed; kill it if it does not. */
static void end_worker(Own *worker, double patience) {
    double end = seconds() + patience;
    close(worker->channel);
    while (worker->process) {
        int status;
        pid_t ended = waitpid(worker->process, &status, WNOHANG);
        if (ended == worker->process || (ended < 0 && errno != EINTR)) break;
        if (seconds() >= end) {
            kill(worker->process, SIGKILL);
            while (waitpid(worker->process, &status, 0) < 0 && errno == EINTR) {
            }
            break;
        }
        nanosleep(&(struct timespec){0, 2000000}, NULL);
    }
    worker->process = 0;
    if (worker->errors) fclose(worker->errors);
    worker->errors = NULL;
}

#endif
