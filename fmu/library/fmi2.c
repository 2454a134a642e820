/* The guard of FMI 2.0; see guard.h. */
#define FMI "fmi2"
#include "guard.h"

typedef void (*logger)(void *environment, const char *name, int status, const char *category,
                       const char *text, ...);
struct callbacks {
    logger log;
    void *(*allocate)(size, size);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
};

struct record {
    struct common common;
    logger log; /* the master's, or none */
    int terminated;
    double point; /* where the last step ended or, if it was not done, where it was to begin */
    struct callbacks callbacks; /* what the exporter calls: it keeps no copy of them */
};
_Static_assert(sizeof(struct record) <= PAGE, "a record has one page");

static void heard(void *environment, const char *name, int status, const char *category,
                  const char *text, ...)
{
    struct record *record = environment;
    if (status >= ERROR) record->common.refused = 1;
    if (!category) category = "";
    if (record->log && wants(&record->common, status, category))
        record->log(record->common.environment, name, status, category, text);
}

static void tell(struct record *record, int status, const char *text)
{
    heard(record, "unit", status, CATEGORY_ERROR, text);
}

/* --- life --------------------------------------------------------------------------------------- */

void *original_fmi2Instantiate(const char *, int, const char *, const char *,
                               const struct callbacks *, int, int);

EXPORTED void *fmi2Instantiate(const char *name, int type, const char *token,
                               const char *resources, const struct callbacks *callbacks,
                               int visible, int logging)
{
    logger log = callbacks ? callbacks->log : 0;
    void *environment = callbacks ? callbacks->environment : 0;
    struct record *record = take_page();
    char *folder = take_page();
    const char *obstacle = !record || !folder ? NO_MEMORY
                         : type != 1 ? NO_CO_SIMULATION
                         : obstacle_to(folder, name, token, resources, "%%");
    if (obstacle) {
        if (log) log(environment, "unit", ERROR, CATEGORY_ERROR, obstacle);
        give_page(record);
        give_page(folder);
        return 0;
    }
    record->common.environment = environment;
    record->common.logging = logging;
    record->log = log;
    record->callbacks.log = heard;
    record->callbacks.environment = record;
    if (callbacks) {
        record->callbacks.allocate = callbacks->allocate;
        record->callbacks.release = callbacks->release;
        record->callbacks.step_finished = callbacks->step_finished;
    }
    record->common.instance = original_fmi2Instantiate(name, type, token, folder,
                                                       &record->callbacks, visible, 1);
    give_page(folder);
    if (record->common.instance) return record;
    give_page(record);
    return 0;
}

FREED_AND_LOGGED(fmi2, int)

int original_fmi2SetupExperiment(void *, int, double, double, int, double);

EXPORTED int fmi2SetupExperiment(struct record *record, int tolerance_defined, double tolerance,
                                 double start, int stop_defined, double stop)
{
    BEGIN(record);
    return ended(&record->common,
                 original_fmi2SetupExperiment(record->common.instance, tolerance_defined,
                                              tolerance, start, stop_defined, stop));
}

#define PASSED_ON(function)                                                          \
    int original_##function(void *);                                                 \
    EXPORTED int function(struct record *record)                                     \
    {                                                                                \
        BEGIN(record);                                                               \
        record->terminated = 0;                                                      \
        return ended(&record->common, original_##function(record->common.instance)); \
    }
PASSED_ON(fmi2EnterInitializationMode)
PASSED_ON(fmi2ExitInitializationMode)
PASSED_ON(fmi2Terminate)
PASSED_ON(fmi2Reset)

/* --- values ------------------------------------------------------------------------------------- */

#define GETTER(name, type)                                                                     \
    int original_fmi2Get##name(void *, const reference *, size, type *);                       \
    EXPORTED int fmi2Get##name(struct record *record, const reference *references, size count, \
                               type *values)                                                   \
    {                                                                                          \
        BEGIN(record);                                                                         \
        if (count && (!references || !values)) REFUSE(record, NO_MEMORY);                      \
        return ended(&record->common, original_fmi2Get##name(record->common.instance,          \
                                                             references, count, values));      \
    }
#define SETTER(name, type)                                                                     \
    int original_fmi2Set##name(void *, const reference *, size, const type *);                 \
    EXPORTED int fmi2Set##name(struct record *record, const reference *references, size count, \
                               const type *values)                                             \
    {                                                                                          \
        BEGIN(record);                                                                         \
        if (count && (!references || !values)) REFUSE(record, NO_MEMORY);                      \
        return ended(&record->common, original_fmi2Set##name(record->common.instance,          \
                                                             references, count, values));      \
    }
GETTER(Real, double)
GETTER(Integer, int)
GETTER(Boolean, int)
GETTER(String, const char *)
SETTER(Real, double)
SETTER(Integer, int)
SETTER(Boolean, int)

int original_fmi2SetString(void *, const reference *, size, const char *const *);

EXPORTED int fmi2SetString(struct record *record, const reference *references, size count,
                           const char *const *values)
{
    BEGIN(record);
    if (count && (!references || !values)) REFUSE(record, NO_MEMORY);
    for (size i = 0; i < count; i++)
        if (!values[i]) REFUSE(record, NO_MEMORY);
    return ended(&record->common, original_fmi2SetString(record->common.instance, references,
                                                         count, values));
}

/* --- steps -------------------------------------------------------------------------------------- */

int original_fmi2DoStep(void *, double, double, int);

EXPORTED int fmi2DoStep(struct record *record, double time, double step, int no_state_before)
{
    BEGIN(record);
    int status = ended(&record->common, original_fmi2DoStep(record->common.instance, time, step,
                                                            no_state_before));
    record->terminated = status == DISCARD; /* of this step; the exporter never takes it back */
    record->point = status == OK ? time + step : time;
    return status;
}

/* What a status is asked for: pending, last successful time, terminated. */
enum { LAST_SUCCESSFUL_TIME = 2, TERMINATED = 3 };

EXPORTED int fmi2GetRealStatus(struct record *record, int kind, double *value)
{
    BEGIN(record);
    if (!value) REFUSE(record, NO_MEMORY);
    if (kind != LAST_SUCCESSFUL_TIME) return DISCARD;
    int status = original_fmi2GetReal(record->common.instance, unit_table + TIME, 1, value);
    *value = in_numbers_of_the_master(*value, record->point);
    return ended(&record->common, status);
}

EXPORTED int fmi2GetBooleanStatus(struct record *record, int kind, int *value)
{
    BEGIN(record);
    if (!value) REFUSE(record, NO_MEMORY);
    if (kind != TERMINATED) return DISCARD;
    *value = record->terminated;
    return OK;
}

/* --- states ------------------------------------------------------------------------------------- */

#define VERSION fmi2
#define GET_STATE GetFMUstate
#define SET_STATE SetFMUstate
#define FREE_STATE FreeFMUstate
#define SIZE_OF_STATE SerializedFMUstateSize
#define WRITE_STATE SerializeFMUstate
#define READ_STATE DeSerializeFMUstate
#include "states.h"

/* --- what the unit does not offer ---------------------------------------------------------------- */

#define NOT_OFFERED(function, status)                                             \
    EXPORTED int function(struct record *record)                                  \
    {                                                                             \
        BEGIN(record);                                                            \
        tell(record, status, #function " is not offered by this unit");           \
        return status;                                                            \
    }
NOT_OFFERED(fmi2GetDirectionalDerivative, ERROR)
NOT_OFFERED(fmi2SetRealInputDerivatives, ERROR)
NOT_OFFERED(fmi2GetRealOutputDerivatives, ERROR)
NOT_OFFERED(fmi2CancelStep, ERROR)
NOT_OFFERED(fmi2GetStatus, DISCARD)
NOT_OFFERED(fmi2GetIntegerStatus, DISCARD)
NOT_OFFERED(fmi2GetStringStatus, DISCARD)
