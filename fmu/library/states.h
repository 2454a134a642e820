/* Saved states, the same in both versions but for the names of the functions. */

#define JOINED(one, other) one##other
#define JOINED_VALUES(one, other) JOINED(one, other)
#define STATE(ending) JOINED_VALUES(VERSION, ending)
#define ORIGINAL_STATE(ending) JOINED_VALUES(original_, STATE(ending))

int ORIGINAL_STATE(GET_STATE)(void *, void **);
int ORIGINAL_STATE(SET_STATE)(void *, void *);
int ORIGINAL_STATE(FREE_STATE)(void *, void **);
int ORIGINAL_STATE(SIZE_OF_STATE)(void *, void *, size *);
int ORIGINAL_STATE(WRITE_STATE)(void *, void *, void *, size);
int ORIGINAL_STATE(READ_STATE)(void *, const void *, size, void **);

EXPORTED int STATE(GET_STATE)(struct record *record, void **state)
{
    BEGIN(record);
    if (!state) REFUSE(record, NO_MEMORY);
    record->common.sized_state = 0;
    void *old = *state;
    int status = ended(&record->common, ORIGINAL_STATE(GET_STATE)(record->common.instance, state));
    if (status != OK) return status;
    /* The new state takes the place of one that the master hands in, which the exporter would leave
       in memory. A pointer that no call has given out is one that the master never set. */
    if (taken_back(&record->common, old))
        status = ended(&record->common, ORIGINAL_STATE(FREE_STATE)(record->common.instance, &old));
    given_out(&record->common, *state);
    return status;
}

EXPORTED int STATE(SET_STATE)(struct record *record, void *state)
{
    BEGIN(record);
    if (!state) REFUSE(record, NO_STATE);
    return ended(&record->common, ORIGINAL_STATE(SET_STATE)(record->common.instance, state));
}

EXPORTED int STATE(FREE_STATE)(struct record *record, void **state)
{
    BEGIN(record);
    if (!state || !*state) return OK; /* as the standards have it */
    record->common.sized_state = 0;
    taken_back(&record->common, *state);
    int status = ORIGINAL_STATE(FREE_STATE)(record->common.instance, state);
    *state = 0;
    return ended(&record->common, status);
}

static int size_of_state(struct record *record, void *state)
{
    if (record->common.sized_state == state) return OK;
    int status = ended(&record->common,
                       ORIGINAL_STATE(SIZE_OF_STATE)(record->common.instance, state,
                                                     &record->common.sized));
    if (status == OK) record->common.sized_state = state;
    return status;
}

EXPORTED int STATE(SIZE_OF_STATE)(struct record *record, void *state, size *found)
{
    BEGIN(record);
    if (!state) REFUSE(record, NO_STATE);
    if (!found) REFUSE(record, NO_MEMORY);
    int status = size_of_state(record, state);
    if (status == OK) *found = record->common.sized;
    return status;
}

EXPORTED int STATE(WRITE_STATE)(struct record *record, void *state, void *bytes, size count)
{
    BEGIN(record);
    if (!state) REFUSE(record, NO_STATE);
    int status = size_of_state(record, state);
    if (status != OK) return status;
    if (count != record->common.sized || !bytes) REFUSE(record, NOT_ITS_SIZE);
    status = ORIGINAL_STATE(WRITE_STATE)(record->common.instance, state, bytes, count);
    return ended(&record->common, status);
}

EXPORTED int STATE(READ_STATE)(struct record *record, const void *bytes, size count, void **state)
{
    BEGIN(record);
    if (!state || (count && !bytes)) REFUSE(record, NO_MEMORY);
    record->common.sized_state = 0;
    int status = ended(&record->common,
                       ORIGINAL_STATE(READ_STATE)(record->common.instance, bytes, count, state));
    if (status == OK) given_out(&record->common, *state);
    return status;
}
