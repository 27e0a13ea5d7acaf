/* FMI 3: model exchange and co-simulation of forces without states. */
#include "instance.c"
#include <stdbool.h>
#include <stdint.h>

#define TIME VARIABLES /* reference of the independent variable */

typedef unsigned int Reference;
typedef void (*Logger)(void *, int, const char *, const char *);
typedef struct {
    Instance common;
    double time;
} Timed;

static void tell(void *instance, int status, const char *text)
{
    Instance *c = instance;
    ((Logger)c->logger)(c->environment, status, "logStatusError", text);
}

static void *new_timed(const char *name, const char *token, void *environment, Logger logger)
{
    Timed *timed;
    Instance *c = new_instance(name, token, environment, (void *)logger, tell);
    if (!c) return NULL;
    timed = realloc(c, sizeof *timed);
    if (!timed) {
        free(c);
        return NULL;
    }
    timed->time = 0.0;
    return timed;
}

EXPORTED const char *fmi3GetVersion(void) { return "3.0"; }
EXPORTED int fmi3SetDebugLogging(void *c, bool on, size_t n, const char *const *categories) { return OK; }
EXPORTED void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible,
                                            bool logging, void *environment, Logger logger)
{
    return new_timed(name, token, environment, logger);
}
EXPORTED void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                           bool logging, bool events, bool early, const Reference *intermediate,
                                           size_t n, void *environment, Logger logger, void *update)
{
    return new_timed(name, token, environment, logger);
}
EXPORTED void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources,
                                                 bool visible, bool logging, void *environment, Logger logger,
                                                 void *clock, void *lock, void *unlock)
{
    return NULL;
}
EXPORTED void fmi3FreeInstance(void *c) { free(c); }
EXPORTED int fmi3EnterInitializationMode(void *c, bool defined, double tolerance, double start, bool stops,
                                         double stop)
{
    ((Timed *)c)->time = start;
    return OK;
}
EXPORTED int fmi3ExitInitializationMode(void *c) { return OK; }
EXPORTED int fmi3EnterEventMode(void *c) { return OK; }
EXPORTED int fmi3Terminate(void *c) { return OK; }
EXPORTED int fmi3Reset(void *c) { reset(c); ((Timed *)c)->time = 0.0; return OK; }

EXPORTED int fmi3GetFloat64(void *c, const Reference *r, size_t n, double *x, size_t size)
{
    size_t i;
    for (i = 0; i < n && i < size; i++) {
        int status = OK;
        if (r[i] == TIME) x[i] = ((Timed *)c)->time;
        else status = read_values(c, r + i, 1, x + i, 1);
        if (status != OK) return status;
    }
    return i < n ? ERROR : OK;
}
EXPORTED int fmi3SetFloat64(void *c, const Reference *r, size_t n, const double *x, size_t size)
{
    return write_values(c, r, n, x, size);
}

/* There are no variables of other types. */
#define ABSENT(type, kind)                                                                              \
    EXPORTED int fmi3Get##kind(void *c, const Reference *r, size_t n, type *x, size_t size)             \
    {                                                                                                   \
        return none_of(n);                                                                              \
    }                                                                                                   \
    EXPORTED int fmi3Set##kind(void *c, const Reference *r, size_t n, const type *x, size_t size)       \
    {                                                                                                   \
        return none_of(n);                                                                              \
    }
ABSENT(float, Float32)
ABSENT(int8_t, Int8)
ABSENT(uint8_t, UInt8)
ABSENT(int16_t, Int16)
ABSENT(uint16_t, UInt16)
ABSENT(int32_t, Int32)
ABSENT(uint32_t, UInt32)
ABSENT(int64_t, Int64)
ABSENT(uint64_t, UInt64)
ABSENT(bool, Boolean)
ABSENT(char *, String)
EXPORTED int fmi3GetBinary(void *c, const Reference *r, size_t n, size_t *sizes, uint8_t **x, size_t size)
{
    return none_of(n);
}
EXPORTED int fmi3SetBinary(void *c, const Reference *r, size_t n, const size_t *sizes, const uint8_t *const *x,
                           size_t size)
{
    return none_of(n);
}
EXPORTED int fmi3GetClock(void *c, const Reference *r, size_t n, bool *x) { return none_of(n); }
EXPORTED int fmi3SetClock(void *c, const Reference *r, size_t n, const bool *x) { return none_of(n); }

EXPORTED int fmi3GetNumberOfVariableDependencies(void *c, Reference r, size_t *n) { return ERROR; }
EXPORTED int fmi3GetVariableDependencies(void *c, Reference r, size_t *elements, Reference *independents,
                                         size_t *others, int *kinds, size_t n)
{
    return ERROR;
}
EXPORTED int fmi3GetFMUState(void *c, void **state) { return store_state(c, state); }
EXPORTED int fmi3SetFMUState(void *c, void *state)
{
    memcpy(&((Instance *)c)->state, state, sizeof(State));
    return OK;
}
EXPORTED int fmi3FreeFMUState(void *c, void **state) { free(*state); *state = NULL; return OK; }
EXPORTED int fmi3SerializedFMUStateSize(void *c, void *state, size_t *size) { *size = sizeof(State); return OK; }
EXPORTED int fmi3SerializeFMUState(void *c, void *state, uint8_t *bytes, size_t size)
{
    if (size < sizeof(State)) return ERROR;
    memcpy(bytes, state, sizeof(State));
    return OK;
}
EXPORTED int fmi3DeserializeFMUState(void *c, const uint8_t *bytes, size_t size, void **state)
{
    if (size < sizeof(State) || !(*state = malloc(sizeof(State)))) return ERROR;
    memcpy(*state, bytes, sizeof(State));
    return OK;
}
EXPORTED int fmi3GetDirectionalDerivative(void *c, const Reference *u, size_t nu, const Reference *k, size_t nk,
                                          const double *seed, size_t ns, double *s, size_t nss)
{
    return ERROR;
}
EXPORTED int fmi3GetAdjointDerivative(void *c, const Reference *u, size_t nu, const Reference *k, size_t nk,
                                      const double *seed, size_t ns, double *s, size_t nss)
{
    return ERROR;
}
EXPORTED int fmi3EnterConfigurationMode(void *c) { return OK; }
EXPORTED int fmi3ExitConfigurationMode(void *c) { return OK; }
EXPORTED int fmi3GetIntervalDecimal(void *c, const Reference *r, size_t n, double *x, int *q) { return none_of(n); }
EXPORTED int fmi3GetIntervalFraction(void *c, const Reference *r, size_t n, uint64_t *x, uint64_t *y, int *q)
{
    return none_of(n);
}
EXPORTED int fmi3GetShiftDecimal(void *c, const Reference *r, size_t n, double *x) { return none_of(n); }
EXPORTED int fmi3GetShiftFraction(void *c, const Reference *r, size_t n, uint64_t *x, uint64_t *y)
{
    return none_of(n);
}
EXPORTED int fmi3SetIntervalDecimal(void *c, const Reference *r, size_t n, const double *x) { return none_of(n); }
EXPORTED int fmi3SetIntervalFraction(void *c, const Reference *r, size_t n, const uint64_t *x, const uint64_t *y)
{
    return none_of(n);
}
EXPORTED int fmi3SetShiftDecimal(void *c, const Reference *r, size_t n, const double *x) { return none_of(n); }
EXPORTED int fmi3SetShiftFraction(void *c, const Reference *r, size_t n, const uint64_t *x, const uint64_t *y)
{
    return none_of(n);
}
EXPORTED int fmi3EvaluateDiscreteStates(void *c) { return OK; }
EXPORTED int fmi3UpdateDiscreteStates(void *c, bool *needed, bool *ends, bool *nominals, bool *values, bool *defined,
                                      double *next)
{
    *needed = *ends = *nominals = *values = *defined = false;
    *next = 0.0;
    return OK;
}
EXPORTED int fmi3EnterContinuousTimeMode(void *c) { return OK; }
EXPORTED int fmi3CompletedIntegratorStep(void *c, bool unchanged, bool *events, bool *ends)
{
    *events = *ends = false;
    return OK;
}
EXPORTED int fmi3SetTime(void *c, double time) { ((Timed *)c)->time = time; return OK; }
EXPORTED int fmi3SetContinuousStates(void *c, const double *x, size_t n) { return none_of(n); }
EXPORTED int fmi3GetContinuousStateDerivatives(void *c, double *x, size_t n) { return none_of(n); }
EXPORTED int fmi3GetEventIndicators(void *c, double *x, size_t n) { return none_of(n); }
EXPORTED int fmi3GetContinuousStates(void *c, double *x, size_t n) { return none_of(n); }
EXPORTED int fmi3GetNominalsOfContinuousStates(void *c, double *x, size_t n) { return none_of(n); }
EXPORTED int fmi3GetNumberOfEventIndicators(void *c, size_t *n) { *n = 0; return OK; }
EXPORTED int fmi3GetNumberOfContinuousStates(void *c, size_t *n) { *n = 0; return OK; }
EXPORTED int fmi3EnterStepMode(void *c) { return OK; }
EXPORTED int fmi3GetOutputDerivatives(void *c, const Reference *r, size_t n, const int32_t *order, double *x,
                                      size_t size)
{
    return none_of(n);
}
EXPORTED int fmi3DoStep(void *c, double time, double step, bool keep, bool *events, bool *ends, bool *early,
                        double *last)
{
    ((Timed *)c)->time = *last = time + step;
    *events = *ends = *early = false;
    return OK;
}
EXPORTED int fmi3ActivateModelPartition(void *c, Reference clock, double time) { return ERROR; }
