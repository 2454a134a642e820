/* A master that is no Python: loads the binary of a unit, makes three steps, prints the travel of
   the punch. Arguments: binary, URI of the resources, value reference of the travel, step [s]. */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>

typedef void (*logger)(void *, const char *, int, const char *, const char *, ...);
struct callbacks {
    logger log;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *step_finished;
    void *environment;
};

static void log_message(void *e, const char *name, int status, const char *category,
                        const char *message, ...)
{
    (void)e, (void)category;
    fprintf(stderr, "%s (status %d): %s\n", name, status, message);
}

int main(int count, char **argument)
{
    if (count != 5) return 64;
    void *binary = dlopen(argument[1], RTLD_NOW | RTLD_LOCAL);
    if (!binary) {
        fprintf(stderr, "%s\n", dlerror());
        return 65;
    }
    void *(*instantiate)(const char *, int, const char *, const char *, const struct callbacks *,
                         int, int) = dlsym(binary, "fmi2Instantiate");
    int (*setup)(void *, int, double, double, int, double) = dlsym(binary, "fmi2SetupExperiment");
    int (*enter)(void *) = dlsym(binary, "fmi2EnterInitializationMode");
    int (*leave)(void *) = dlsym(binary, "fmi2ExitInitializationMode");
    int (*step)(void *, double, double, int) = dlsym(binary, "fmi2DoStep");
    int (*get)(void *, const unsigned *, size_t, double *) = dlsym(binary, "fmi2GetReal");
    int (*terminate)(void *) = dlsym(binary, "fmi2Terminate");
    void (*release)(void *) = dlsym(binary, "fmi2FreeInstance");

    struct callbacks callbacks = {log_message, calloc, free, NULL, NULL};
    void *unit = instantiate("host", 1, "", argument[2], &callbacks, 0, 1);
    if (!unit) return 66;
    const unsigned travel_reference = (unsigned)atoi(argument[3]);
    const double size = atof(argument[4]);
    double travel = -1.0;
    int status = setup(unit, 0, 0.0, 0.0, 0, 0.0) | enter(unit) | leave(unit);
    for (int i = 0; i < 3; i++) status |= step(unit, i * size, size, 1);
    status |= get(unit, &travel_reference, 1, &travel) | terminate(unit);
    release(unit);
    printf("%.17g\n", travel);
    return status;
}
