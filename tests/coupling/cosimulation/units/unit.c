/* A unit of FMI 2.0 or 3.0 around the model in model.h, which defines
   REALS, WHOLES, TRUTHS, TEXTS: how many values of each kind there are
   OFFSET, SIZE: FMI 3.0, where the reals of a value reference begin and how many there are
   NUMBERS, size_of(v, k): FMI 3.0, structural parameters, and how many reals there are with them
   begin(u), answer(u), advance(u, t, h): 0 done, 2 discarded (then u->reached), 3 error */
#include <stdlib.h>
#include <string.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>

#if FMI == 2
#include "fmi2Functions.h"
#else
#include "fmi3Functions.h"
#include <stdbool.h>
#endif

typedef struct {
    double r[REALS + 1];
    int i[WHOLES + 1];
    int b[TRUTHS + 1];
    char s[TEXTS + 1][64];
    unsigned long long n[NUMBERS + 1];
    double reached;
    int end;
} Values;

typedef struct {
    Values v;
    void *environment;
    void *logger;
    char name[64];
    int configuring;
    int begun;
} Unit;

static void say(Unit *u, int status, const char *text);
#include "model.h"
#ifndef LARGEST
#define LARGEST 1000
#endif

#if FMI == 2
static void say(Unit *u, int status, const char *text) {
    const fmi2CallbackFunctions *f = u->logger;
    f->logger(f->componentEnvironment, u->name, (fmi2Status)status, "model", "%s", text);
}
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String k[]) { return fmi2OK; }
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String place,
                              const fmi2CallbackFunctions *f, fmi2Boolean visible, fmi2Boolean log) {
    if (strcmp(guid, TOKEN)) return NULL;
    Unit *u = calloc(1, sizeof(Unit));
    u->logger = (void *)f;
    strncpy(u->name, name, 63);
    begin(&u->v);
    return u;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean d, fmi2Real t, fmi2Real a, fmi2Boolean e, fmi2Real b) { return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { begin(&((Unit *)c)->v); return fmi2OK; }
#define ACCESS(Kind, Type, member, count)                                                          \
    fmi2Status fmi2Get##Kind(fmi2Component c, const fmi2ValueReference vr[], size_t n, Type x[]) { \
        Unit *u = c;                                                                               \
        answer(&u->v);                                                                             \
        for (size_t k = 0; k < n; k++) {                                                           \
            if (vr[k] >= count) return fmi2Error;                                                  \
            x[k] = u->v.member[vr[k]];                                                             \
        }                                                                                          \
        return fmi2OK;                                                                             \
    }
#define TAKE(Kind, Type, member, count)                                                            \
    fmi2Status fmi2Set##Kind(fmi2Component c, const fmi2ValueReference vr[], size_t n,             \
                             const Type x[]) {                                                     \
        Unit *u = c;                                                                               \
        for (size_t k = 0; k < n; k++) {                                                           \
            if (vr[k] >= count) return fmi2Error;                                                  \
            u->v.member[vr[k]] = x[k];                                                             \
        }                                                                                          \
        return fmi2OK;                                                                             \
    }
ACCESS(Real, fmi2Real, r, REALS)
TAKE(Real, fmi2Real, r, REALS)
ACCESS(Integer, fmi2Integer, i, WHOLES)
TAKE(Integer, fmi2Integer, i, WHOLES)
ACCESS(Boolean, fmi2Boolean, b, TRUTHS)
TAKE(Boolean, fmi2Boolean, b, TRUTHS)
ACCESS(String, fmi2String, s, TEXTS)
fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String x[]) {
    for (size_t k = 0; k < n; k++) {
        if (vr[k] >= TEXTS) return fmi2Error;
        snprintf(((Unit *)c)->v.s[vr[k]], 64, "%s", x[k]);
    }
    return fmi2OK;
}
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s) {
    if (*s == NULL) *s = malloc(sizeof(Values));
    memcpy(*s, &((Unit *)c)->v, sizeof(Values));
    return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) { memcpy(&((Unit *)c)->v, s, sizeof(Values)); return fmi2OK; }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s) { free(*s); *s = NULL; return fmi2OK; }
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s, size_t *n) { *n = sizeof(Values); return fmi2OK; }
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte x[], size_t n) { memcpy(x, s, n); return fmi2OK; }
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte x[], size_t n, fmi2FMUstate *s) {
    if (n != sizeof(Values)) return fmi2Error;
    if (*s == NULL) *s = malloc(sizeof(Values));
    memcpy(*s, x, n);
    return fmi2OK;
}
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference a[], size_t n, const fmi2ValueReference b[], size_t m, const fmi2Real d[], fmi2Real e[]) { return fmi2Error; }
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference a[], size_t n, const fmi2Integer o[], const fmi2Real v[]) { return fmi2Error; }
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference a[], size_t n, const fmi2Integer o[], fmi2Real v[]) { return fmi2Error; }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no) {
    Unit *u = c;
    int status = advance(u, &u->v, t, h);
    return (fmi2Status)status;
}
fmi2Status fmi2CancelStep(fmi2Component c) { return fmi2Error; }
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind k, fmi2Status *v) { return fmi2Discard; }
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind k, fmi2Real *v) { *v = ((Unit *)c)->v.reached; return fmi2OK; }
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind k, fmi2Integer *v) { return fmi2Discard; }
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind k, fmi2Boolean *v) { *v = ((Unit *)c)->v.end; return fmi2OK; }
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind k, fmi2String *v) { return fmi2Discard; }

#else

static void say(Unit *u, int status, const char *text) {
    ((fmi3LogMessageCallback)u->logger)(u->environment, (fmi3Status)status, "model", text);
}
const char *fmi3GetVersion(void) { return "3.0"; }
fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String k[]) { return fmi3OK; }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String place, fmi3Boolean visible,
                                         fmi3Boolean log, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference r[], size_t n, fmi3InstanceEnvironment e,
                                         fmi3LogMessageCallback logger, fmi3IntermediateUpdateCallback update) {
    if (strcmp(token, TOKEN)) return NULL;
    Unit *u = calloc(1, sizeof(Unit));
    u->logger = (void *)logger;
    u->environment = e;
    begin(&u->v);
    return u;
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean d, fmi3Float64 t, fmi3Float64 a, fmi3Boolean e, fmi3Float64 b) {
    ((Unit *)c)->begun = 1;
    return ((Unit *)c)->configuring ? fmi3Error : fmi3OK;
}
#define NOTHING(name) fmi3Status fmi3##name(fmi3Instance c) { return fmi3OK; }
NOTHING(ExitInitializationMode)
NOTHING(EnterEventMode)
NOTHING(Terminate)
NOTHING(EnterStepMode)
fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) {
    Unit *u = c;
    if (NUMBERS == 0 || u->begun || u->configuring) {
        say(u, 3, "there is no configuration mode now");
        return fmi3Error;
    }
    u->configuring = 1;
    return fmi3OK;
}
fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) {
    Unit *u = c;
    if (!u->configuring) return fmi3Error;
    u->configuring = 0;
    memset(u->v.r, 0, sizeof(u->v.r)); /* the values of arrays that are resized are gone */
    return fmi3OK;
}
fmi3Status fmi3Reset(fmi3Instance c) { begin(&((Unit *)c)->v); return fmi3OK; }
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 x[], size_t m) {
    Unit *u = c;
    size_t at = 0;
    answer(&u->v);
    for (size_t k = 0; k < n; k++) {
        if (vr[k] >= sizeof(OFFSET) / sizeof(int)) return fmi3Error;
        size_t size = size_of(&u->v, vr[k]);
        if (at + size > m) return fmi3Error;
        memcpy(x + at, u->v.r + OFFSET[vr[k]], size * sizeof(double));
        at += size;
    }
    return at == m ? fmi3OK : fmi3Error;
}
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 x[], size_t m) {
    Unit *u = c;
    size_t at = 0;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] >= sizeof(OFFSET) / sizeof(int)) return fmi3Error;
        size_t size = size_of(&u->v, vr[k]);
        if (at + size > m || u->configuring) return fmi3Error;
        memcpy(u->v.r + OFFSET[vr[k]], x + at, size * sizeof(double));
        at += size;
    }
    return at == m ? fmi3OK : fmi3Error;
}
fmi3Status fmi3GetUInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3UInt64 x[], size_t m) {
    for (size_t k = 0; k < n; k++) x[k] = ((Unit *)c)->v.n[vr[k] - 4000];
    return fmi3OK;
}
fmi3Status fmi3SetUInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3UInt64 x[], size_t m) {
    Unit *u = c;
    for (size_t k = 0; k < n; k++) {
        if (!u->configuring) return fmi3Error;
        if (x[k] > LARGEST) {
            say(u, 3, "there is no room for that size");
            return fmi3Error;
        }
        u->v.n[vr[k] - 4000] = x[k];
    }
    return fmi3OK;
}
/* value references of the other kinds begin at 1000, 2000 and 3000 */
#define ACCESS3(Kind, Type, member, first)                                                          \
    fmi3Status fmi3Get##Kind(fmi3Instance c, const fmi3ValueReference vr[], size_t n, Type x[], size_t m) { \
        answer(&((Unit *)c)->v);                                                                    \
        for (size_t k = 0; k < n; k++) x[k] = ((Unit *)c)->v.member[vr[k] - first];                 \
        return fmi3OK;                                                                              \
    }
#define TAKE3(Kind, Type, member, first)                                                            \
    fmi3Status fmi3Set##Kind(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const Type x[], size_t m) { \
        for (size_t k = 0; k < n; k++) ((Unit *)c)->v.member[vr[k] - first] = x[k];                 \
        return fmi3OK;                                                                              \
    }
ACCESS3(Int32, fmi3Int32, i, 1000)
TAKE3(Int32, fmi3Int32, i, 1000)
ACCESS3(Int64, fmi3Int64, i, 1000)
TAKE3(Int64, fmi3Int64, i, 1000)
ACCESS3(Boolean, fmi3Boolean, b, 2000)
TAKE3(Boolean, fmi3Boolean, b, 2000)
ACCESS3(String, fmi3String, s, 3000)
fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3String x[], size_t m) {
    for (size_t k = 0; k < n; k++) snprintf(((Unit *)c)->v.s[vr[k] - 3000], 64, "%s", x[k]);
    return fmi3OK;
}
#define NONE(Kind, Type)                                                                            \
    fmi3Status fmi3Get##Kind(fmi3Instance c, const fmi3ValueReference vr[], size_t n, Type x[], size_t m) { return fmi3Error; } \
    fmi3Status fmi3Set##Kind(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const Type x[], size_t m) { return fmi3Error; }
NONE(Float32, fmi3Float32)
NONE(Int8, fmi3Int8)
NONE(UInt8, fmi3UInt8)
NONE(Int16, fmi3Int16)
NONE(UInt16, fmi3UInt16)
NONE(UInt32, fmi3UInt32)
fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *s) {
    if (*s == NULL) *s = malloc(sizeof(Values));
    memcpy(*s, &((Unit *)c)->v, sizeof(Values));
    return fmi3OK;
}
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState s) { memcpy(&((Unit *)c)->v, s, sizeof(Values)); return fmi3OK; }
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *s) { free(*s); *s = NULL; return fmi3OK; }
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState s, size_t *n) { *n = sizeof(Values); return fmi3OK; }
fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState s, fmi3Byte x[], size_t n) { memcpy(x, s, n); return fmi3OK; }
fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte x[], size_t n, fmi3FMUState *s) {
    if (n != sizeof(Values)) return fmi3Error;
    if (*s == NULL) *s = malloc(sizeof(Values));
    memcpy(*s, x, n);
    return fmi3OK;
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no, fmi3Boolean *event,
                      fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *last) {
    Unit *u = c;
    int status = advance(u, &u->v, t, h);
    *event = false;
    *early = false;
    *end = u->v.end;
    *last = status == 2 ? u->v.reached : t + h;
    return (fmi3Status)status;
}
#endif
