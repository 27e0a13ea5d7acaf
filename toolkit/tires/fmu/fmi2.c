/* FMI 2: model exchange and co-simulation of forces without states. */
#include "instance.c"

typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    Logger logger;
    void *allocate, *release, *step_finished;
    void *environment;
} Callbacks;
typedef struct {
    int newDiscreteStatesNeeded, terminateSimulation, nominalsChanged, valuesChanged, eventTimeDefined;
    double eventTime;
} Events;

static void tell(void *instance, int status, const char *text)
{
    Instance *c = instance;
    ((Logger)c->logger)(c->environment, c->name, status, "logStatusError", "%s", text);
}

EXPORTED const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORTED const char *fmi2GetVersion(void) { return "2.0"; }
EXPORTED int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const *categories) { return OK; }
EXPORTED void *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                               const Callbacks *callbacks, int visible, int logging)
{
    return new_instance(name, token, callbacks->environment, (void *)callbacks->logger, tell);
}
EXPORTED void fmi2FreeInstance(void *c) { free(c); }
EXPORTED int fmi2SetupExperiment(void *c, int defined, double tolerance, double start, int stops, double stop)
{
    return OK;
}
EXPORTED int fmi2EnterInitializationMode(void *c) { return OK; }
EXPORTED int fmi2ExitInitializationMode(void *c) { return OK; }
EXPORTED int fmi2Terminate(void *c) { return OK; }
EXPORTED int fmi2Reset(void *c) { reset(c); return OK; }
EXPORTED int fmi2GetReal(void *c, const unsigned int *r, size_t n, double *x) { return read_values(c, r, n, x, n); }
EXPORTED int fmi2SetReal(void *c, const unsigned int *r, size_t n, const double *x)
{
    return write_values(c, r, n, x, n);
}
EXPORTED int fmi2GetInteger(void *c, const unsigned int *r, size_t n, int *x) { return none_of(n); }
EXPORTED int fmi2GetBoolean(void *c, const unsigned int *r, size_t n, int *x) { return none_of(n); }
EXPORTED int fmi2GetString(void *c, const unsigned int *r, size_t n, const char **x) { return none_of(n); }
EXPORTED int fmi2SetInteger(void *c, const unsigned int *r, size_t n, const int *x) { return none_of(n); }
EXPORTED int fmi2SetBoolean(void *c, const unsigned int *r, size_t n, const int *x) { return none_of(n); }
EXPORTED int fmi2SetString(void *c, const unsigned int *r, size_t n, const char *const *x) { return none_of(n); }
EXPORTED int fmi2GetFMUstate(void *c, void **state) { return store_state(c, state); }
EXPORTED int fmi2SetFMUstate(void *c, void *state)
{
    memcpy(&((Instance *)c)->state, state, sizeof(State));
    return OK;
}
EXPORTED int fmi2FreeFMUstate(void *c, void **state) { free(*state); *state = NULL; return OK; }
EXPORTED int fmi2SerializedFMUstateSize(void *c, void *state, size_t *size) { *size = sizeof(State); return OK; }
EXPORTED int fmi2SerializeFMUstate(void *c, void *state, char *bytes, size_t size)
{
    if (size < sizeof(State)) return ERROR;
    memcpy(bytes, state, sizeof(State));
    return OK;
}
EXPORTED int fmi2DeSerializeFMUstate(void *c, const char *bytes, size_t size, void **state)
{
    if (size < sizeof(State) || !(*state = malloc(sizeof(State)))) return ERROR;
    memcpy(*state, bytes, sizeof(State));
    return OK;
}
EXPORTED int fmi2GetDirectionalDerivative(void *c, const unsigned int *u, size_t nu, const unsigned int *k,
                                          size_t nk, const double *dk, double *du)
{
    return ERROR;
}
EXPORTED int fmi2EnterEventMode(void *c) { return OK; }
EXPORTED int fmi2NewDiscreteStates(void *c, Events *events) { memset(events, 0, sizeof *events); return OK; }
EXPORTED int fmi2EnterContinuousTimeMode(void *c) { return OK; }
EXPORTED int fmi2CompletedIntegratorStep(void *c, int unchanged, int *events, int *ends)
{
    *events = *ends = 0;
    return OK;
}
EXPORTED int fmi2SetTime(void *c, double time) { return OK; }
EXPORTED int fmi2SetContinuousStates(void *c, const double *x, size_t n) { return none_of(n); }
EXPORTED int fmi2GetDerivatives(void *c, double *x, size_t n) { return none_of(n); }
EXPORTED int fmi2GetEventIndicators(void *c, double *x, size_t n) { return none_of(n); }
EXPORTED int fmi2GetContinuousStates(void *c, double *x, size_t n) { return none_of(n); }
EXPORTED int fmi2GetNominalsOfContinuousStates(void *c, double *x, size_t n) { return none_of(n); }
EXPORTED int fmi2SetRealInputDerivatives(void *c, const unsigned int *r, size_t n, const int *order,
                                         const double *x)
{
    return none_of(n);
}
EXPORTED int fmi2GetRealOutputDerivatives(void *c, const unsigned int *r, size_t n, const int *order, double *x)
{
    return none_of(n);
}
EXPORTED int fmi2DoStep(void *c, double time, double step, int keep) { return OK; }
EXPORTED int fmi2CancelStep(void *c) { return ERROR; }
EXPORTED int fmi2GetStatus(void *c, int kind, int *value) { return DISCARD; }
EXPORTED int fmi2GetRealStatus(void *c, int kind, double *value) { return DISCARD; }
EXPORTED int fmi2GetIntegerStatus(void *c, int kind, int *value) { return DISCARD; }
EXPORTED int fmi2GetBooleanStatus(void *c, int kind, int *value) { return DISCARD; }
EXPORTED int fmi2GetStringStatus(void *c, int kind, const char **value) { return DISCARD; }
