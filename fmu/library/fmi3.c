/* The guard of FMI 3.0; see guard.h. */
#define FMI "fmi3"
#include "guard.h"

typedef void (*logger)(void *environment, int status, const char *category, const char *text);

struct record {
    struct common common;
    logger log; /* the master's, or none */
};
_Static_assert(sizeof(struct record) <= PAGE, "a record has one page");

static void heard(void *environment, int status, const char *category, const char *text)
{
    struct record *record = environment;
    if (status >= ERROR) record->common.refused = 1;
    if (!category) category = "";
    if (record->log && wants(&record->common, status, category))
        record->log(record->common.environment, status, category, text);
}

static void tell(struct record *record, int status, const char *text)
{
    heard(record, status, CATEGORY_ERROR, text);
}

/* --- life --------------------------------------------------------------------------------------- */

void *original_fmi3InstantiateCoSimulation(const char *, const char *, const char *, _Bool, _Bool,
                                           _Bool, _Bool, const reference *, size, void *, logger,
                                           void *);

EXPORTED void *
fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources,
                            _Bool visible, _Bool logging, _Bool events, _Bool early,
                            const reference *needed, size count, void *environment, logger log,
                            void *update)
{
    struct record *record = take_page();
    char *folder = take_page();
    const char *obstacle = !record || !folder ? NO_MEMORY
                         : obstacle_to(folder, name, token, resources, "%");
    if (obstacle) {
        if (log) log(environment, ERROR, CATEGORY_ERROR, obstacle);
        give_page(record);
        give_page(folder);
        return 0;
    }
    record->common.environment = environment;
    record->common.logging = logging;
    record->log = log;
    record->common.instance = original_fmi3InstantiateCoSimulation(
        name, token, folder, visible, 1, events, early, needed, count, record, heard, update);
    give_page(folder);
    if (record->common.instance) return record;
    give_page(record);
    return 0;
}

EXPORTED void *fmi3InstantiateModelExchange(const char *name, const char *token,
                                            const char *resources, _Bool visible, _Bool logging,
                                            void *environment, logger log)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    if (log) log(environment, ERROR, CATEGORY_ERROR, NO_CO_SIMULATION);
    return 0;
}

EXPORTED void *fmi3InstantiateScheduledExecution(const char *name, const char *token,
                                                 const char *resources, _Bool visible,
                                                 _Bool logging, void *environment, logger log)
{
    return fmi3InstantiateModelExchange(name, token, resources, visible, logging, environment, log);
}

FREED_AND_LOGGED(fmi3, _Bool)

int original_fmi3SetContinuousStates(void *, const double *, size);
int original_fmi3EnterInitializationMode(void *, _Bool, double, double, _Bool, double);

/* Where the exporter drops start and stop time, they go through a function that a unit without
   continuous states has no other use for; `fmi3.py` knows them by the first number. */
static const double EXPERIMENT = -3.0e-300;

EXPORTED int fmi3EnterInitializationMode(struct record *record, _Bool tolerance_defined,
                                         double tolerance, double start, _Bool stop_defined,
                                         double stop)
{
    BEGIN(record);
    double times[3] = {EXPERIMENT, start, stop};
    int status = ended(&record->common,
                       original_fmi3SetContinuousStates(record->common.instance, times,
                                                        stop_defined ? 3 : 2));
    if (status != OK) return status;
    status = original_fmi3EnterInitializationMode(record->common.instance, tolerance_defined,
                                                  tolerance, start, stop_defined, stop);
    return ended(&record->common, status);
}

#define PASSED_ON(function)                                                        \
    int original_##function(void *);                                               \
    EXPORTED int function(struct record *record)                                   \
    {                                                                              \
        BEGIN(record);                                                             \
        return ended(&record->common, original_##function(record->common.instance)); \
    }
PASSED_ON(fmi3ExitInitializationMode)
PASSED_ON(fmi3Terminate)
PASSED_ON(fmi3Reset)

/* --- values ------------------------------------------------------------------------------------- */

/* How many values references stand for: one for each that means no variable of this kind. */
static size values_of(const reference *references, size count, unsigned kind, int *all_known)
{
    size found = 0;
    *all_known = 1;
    for (size i = 0; i < count; i++) {
        unsigned entry = references[i] < unit_table[COUNT] ? unit_table[FIRST + references[i]] : 0;
        if (entry && (entry & 3) == kind) {
            found += entry >> 2;
        } else {
            found++;
            *all_known = 0;
        }
    }
    return found;
}

/* The exporter reads as many values as the master has asked for from a list that holds those that
   there are: it never gets to see a larger number. One value of one field is its first: masters
   without arrays (fmucontainer) ask so, and take any other status for the end. */
#define GETTER(name, type, kind)                                                               \
    int original_fmi3Get##name(void *, const reference *, size, type *, size);                 \
    EXPORTED int fmi3Get##name(struct record *record, const reference *references, size count, \
                               type *values, size value_count)                                 \
    {                                                                                          \
        BEGIN(record);                                                                         \
        if ((count && !references) || (value_count && !values)) REFUSE(record, NO_MEMORY);     \
        int all_known;                                                                         \
        size wanted = values_of(references, count, kind, &all_known);                          \
        int status = original_fmi3Get##name(record->common.instance, references, count,        \
                                            values, value_count < wanted ? value_count : wanted); \
        if (all_known && value_count != wanted && !(count == 1 && value_count == 1))           \
            tell(record, ERROR, "fmi3Get" #name " was asked for another number of values than " \
                                "its references have");                                        \
        return ended(&record->common, status);                                                 \
    }
#define SETTER(name, type)                                                                     \
    int original_fmi3Set##name(void *, const reference *, size, const type *, size);           \
    EXPORTED int fmi3Set##name(struct record *record, const reference *references, size count, \
                               const type *values, size value_count)                           \
    {                                                                                          \
        BEGIN(record);                                                                         \
        if ((count && !references) || (value_count && !values)) REFUSE(record, NO_MEMORY);     \
        return ended(&record->common, original_fmi3Set##name(record->common.instance,          \
                                                             references, count, values,        \
                                                             value_count));                    \
    }
GETTER(Float64, double, REAL)
GETTER(Int32, int, INTEGER)
GETTER(Int64, long, INTEGER) /* of enumerations */
GETTER(UInt64, unsigned long, NONE)
GETTER(Boolean, _Bool, BOOLEAN)
GETTER(String, const char *, STRING)
SETTER(Float64, double)
SETTER(Int32, int)
SETTER(Int64, long)
SETTER(UInt64, unsigned long)
SETTER(Boolean, _Bool)

int original_fmi3SetString(void *, const reference *, size, const char *const *, size);

EXPORTED int fmi3SetString(struct record *record, const reference *references, size count,
                           const char *const *values, size value_count)
{
    BEGIN(record);
    if ((count && !references) || (value_count && !values)) REFUSE(record, NO_MEMORY);
    for (size i = 0; i < value_count; i++)
        if (!values[i]) REFUSE(record, NO_MEMORY);
    /* The exporter drops texts beyond the number of references, as if they had been set. Without
       any the unit refuses the call, and with it the next step. */
    if (value_count > count) value_count = 0;
    return ended(&record->common, original_fmi3SetString(record->common.instance, references,
                                                         count, values, value_count));
}

/* --- steps -------------------------------------------------------------------------------------- */

int original_fmi3DoStep(void *, double, double, _Bool, _Bool *, _Bool *, _Bool *, double *);

EXPORTED int fmi3DoStep(struct record *record, double time, double step, _Bool no_state_before,
                        _Bool *event, _Bool *terminate, _Bool *early, double *last)
{
    BEGIN(record);
    _Bool ends = 0, happens = 0, comes = 0;
    double reached = time;
    int status = original_fmi3DoStep(record->common.instance, time, step, no_state_before, &happens,
                                     &ends, &comes, &reached);
    status = ended(&record->common, status);
    if (status != OK && status != FATAL) { /* the exporter gives the time that was asked for */
        double value = 0.0;
        original_fmi3GetFloat64(record->common.instance, unit_table + TIME, 1, &value, 1);
        reached = in_numbers_of_the_master(value, time);
    }
    if (event) *event = 0;
    if (terminate) *terminate = ends;
    if (early) *early = 0;
    if (last) *last = reached;
    return status;
}

/* --- states ------------------------------------------------------------------------------------- */

#define VERSION fmi3
#define GET_STATE GetFMUState
#define SET_STATE SetFMUState
#define FREE_STATE FreeFMUState
#define SIZE_OF_STATE SerializedFMUStateSize
#define WRITE_STATE SerializeFMUState
#define READ_STATE DeserializeFMUState
#include "states.h"

/* --- what the unit does not offer ---------------------------------------------------------------- */

#define NOT_OFFERED(function)                                            \
    EXPORTED int function(struct record *record)                         \
    {                                                                    \
        BEGIN(record);                                                   \
        REFUSE(record, #function " is not offered by this unit");        \
    }
#define NEITHER_GOT_NOR_SET(what) NOT_OFFERED(fmi3Get##what) NOT_OFFERED(fmi3Set##what)
NEITHER_GOT_NOR_SET(Float32)
NEITHER_GOT_NOR_SET(Int8)
NEITHER_GOT_NOR_SET(Int16)
NEITHER_GOT_NOR_SET(UInt8)
NEITHER_GOT_NOR_SET(UInt16)
NEITHER_GOT_NOR_SET(UInt32)
NEITHER_GOT_NOR_SET(Clock)
NEITHER_GOT_NOR_SET(Binary)
NEITHER_GOT_NOR_SET(IntervalDecimal)
NEITHER_GOT_NOR_SET(IntervalFraction)
NEITHER_GOT_NOR_SET(ShiftDecimal)
NEITHER_GOT_NOR_SET(ShiftFraction)
NEITHER_GOT_NOR_SET(ContinuousStates)
NOT_OFFERED(fmi3GetContinuousStateDerivatives)
NOT_OFFERED(fmi3GetNominalsOfContinuousStates)
NOT_OFFERED(fmi3GetNumberOfContinuousStates)
NOT_OFFERED(fmi3GetEventIndicators)
NOT_OFFERED(fmi3GetNumberOfEventIndicators)
NOT_OFFERED(fmi3GetNumberOfVariableDependencies)
NOT_OFFERED(fmi3GetVariableDependencies)
NOT_OFFERED(fmi3GetDirectionalDerivative)
NOT_OFFERED(fmi3GetAdjointDerivative)
NOT_OFFERED(fmi3GetOutputDerivatives)
NOT_OFFERED(fmi3SetTime)
NOT_OFFERED(fmi3UpdateDiscreteStates)
NOT_OFFERED(fmi3EvaluateDiscreteStates)
NOT_OFFERED(fmi3ActivateModelPartition)
NOT_OFFERED(fmi3CompletedIntegratorStep)
NOT_OFFERED(fmi3EnterContinuousTimeMode)
NOT_OFFERED(fmi3EnterConfigurationMode)
NOT_OFFERED(fmi3ExitConfigurationMode)
NOT_OFFERED(fmi3EnterEventMode)
NOT_OFFERED(fmi3EnterStepMode)
