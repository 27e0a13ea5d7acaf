/* What FMI 2 and FMI 3 share: one instance is its variables; outputs are worked out when they are asked for. */
#include "tire.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED __attribute__((visibility("default")))
#endif

enum { OK, WARNING, DISCARD, ERROR, FATAL };

typedef struct {
    double value[VARIABLES];
    int fresh;
} State;

typedef struct {
    State state;
    void *environment;
    void (*tell)(void *instance, int status, const char *text);
    void *logger;
    char name[64];
} Instance;

static const char *const variable_names[] = VARIABLE_NAMES;
static const double variable_starts[] = VARIABLE_STARTS;

static void reset(Instance *c)
{
    memcpy(c->state.value, variable_starts, sizeof variable_starts);
    c->state.fresh = 0;
}

static int complain(Instance *c, int status, const char *text)
{
    if (c->logger) c->tell(c, status, text);
    return status;
}

static Instance *new_instance(const char *name, const char *token, void *environment, void *logger,
                              void (*tell)(void *, int, const char *))
{
    Instance *c = calloc(1, sizeof *c);
    if (!c) return NULL;
    c->environment = environment;
    c->logger = logger;
    c->tell = tell;
    snprintf(c->name, sizeof c->name, "%s", name ? name : MODEL_NAME);
    if (!token || strcmp(token, MODEL_TOKEN) != 0) {
        complain(c, ERROR, "the token is not the one of modelDescription.xml");
        free(c);
        return NULL;
    }
    reset(c);
    return c;
}

static int read_values(Instance *c, const unsigned int *references, size_t count, double *values, size_t size)
{
    size_t i;
    double *value = c->state.value;
    if (size < count) return complain(c, ERROR, "fewer places than variables");
    for (i = 0; i < count; i++) {
        if (references[i] >= VARIABLES) return complain(c, ERROR, "no variable has this reference");
        if (references[i] >= FIRST_OUTPUT && !c->state.fresh) {
            tire_forces(value, value + FIRST_OUTPUT);
            c->state.fresh = 1;
        }
        if (!isfinite(value[references[i]])) {
            char text[128];
            snprintf(text, sizeof text, "%s is not finite at these inputs", variable_names[references[i]]);
            return complain(c, ERROR, text);
        }
        values[i] = value[references[i]];
    }
    return OK;
}

static int write_values(Instance *c, const unsigned int *references, size_t count, const double *values,
                        size_t size)
{
    size_t i;
    if (size < count) return complain(c, ERROR, "fewer numbers than variables");
    for (i = 0; i < count; i++) {
        if (references[i] >= FIRST_OUTPUT) return complain(c, ERROR, "only inputs and parameters are set");
        if (!isfinite(values[i])) return complain(c, ERROR, "an input is no finite number");
    }
    for (i = 0; i < count; i++) c->state.value[references[i]] = values[i];
    c->state.fresh = 0;
    return OK;
}

static int store_state(Instance *c, void **state)
{
    if (!*state) *state = malloc(sizeof(State));
    if (!*state) return complain(c, ERROR, "no memory for a state");
    memcpy(*state, &c->state, sizeof(State));
    return OK;
}

static int none_of(size_t count) { return count ? ERROR : OK; }
