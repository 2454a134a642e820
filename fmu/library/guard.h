/* What stands between a master and the exporter's library, in both versions of FMI.

   The exporters answer success to every call that did not end the instance, whatever Python said
   of it, and call the master's logger although there may be none. The functions of this guard take
   their places in the library (link.py): they give the master a record of their own instead of the
   exporter's instance, hear all texts, answer with an error where one of them was an error, and
   hand on to the master what it has asked for.

   No library is needed: the code is position-independent, has no data that changes, and takes the
   memory of its records from the system. A Python without a compiler links the objects beside this
   file; `python -m lcmchain.fmu.library.compile` makes them anew. */

#pragma GCC visibility push(hidden)

/* Hash of the sources that an object was made of (compile.py). */
__attribute__((used, section(".comment.sources"))) static const char sources[] = SOURCES;

typedef unsigned long size;
typedef unsigned int reference;
enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { REAL, INTEGER, BOOLEAN, STRING, NONE };

/* Of the unit: how many value references there are, that of the time, the sum of its module's
   bytes (link.py), and for every reference 4 * count + kind of what it means (FMI 3.0 only). */
extern const unsigned unit_table[];
enum { COUNT, TIME, SUM_OF_MODULE, FIRST };

#define EXPORTED __attribute__((visibility("default")))
#define CATEGORY_ERROR "logStatusError"

static int same(const char *one, const char *other)
{
    while (*one && *one == *other) one++, other++;
    return *one == *other;
}

/* The bit of a category of log messages, ~0 for all, 0 for one that the unit does not have. */
static unsigned bit_of(const char *category)
{
    if (same(category, "logAll")) return ~0u;
    if (same(category, "logEvents")) return 1;
    if (same(category, "logStatusWarning")) return 2;
    if (same(category, "logStatusDiscard")) return 4;
    if (same(category, CATEGORY_ERROR)) return 8;
    return 0;
}

/* One page of memory from the system, and back; the content of a file. */
enum { PAGE = 4096, MMAP = 9, MUNMAP = 11, READ_WRITE = 3, PRIVATE_ANONYMOUS = 0x22 };
enum { READ, WRITE, OPEN, CLOSE, CLOSED_ON_EXECUTION = 0x80000, INTERRUPTED = -4 };

static void *take_page(void)
{
    long answer;
    register long flags __asm__("r10") = PRIVATE_ANONYMOUS;
    register long file __asm__("r8") = -1;
    register long offset __asm__("r9") = 0;
    __asm__ volatile("syscall" : "=a"(answer)
                     : "a"((long)MMAP), "D"(0L), "S"((long)PAGE), "d"((long)READ_WRITE),
                       "r"(flags), "r"(file), "r"(offset)
                     : "rcx", "r11", "memory");
    return answer < 0 && answer > -PAGE ? 0 : (void *)answer;
}

static void give_page(void *page)
{
    if (!page) return;
    long answer;
    __asm__ volatile("syscall" : "=a"(answer)
                     : "a"((long)MUNMAP), "D"(page), "S"((long)PAGE)
                     : "rcx", "r11", "memory");
    (void)answer;
}

static long call_system(long number, long first, const void *second, long third)
{
    long answer;
    __asm__ volatile("syscall" : "=a"(answer)
                     : "a"(number), "D"(first), "S"(second), "d"(third)
                     : "rcx", "r11", "memory");
    return answer;
}

/* The file descriptor of a file that can be read, negative for one that cannot. */
static long opened(const char *path)
{
    return call_system(OPEN, (long)path, (const void *)CLOSED_ON_EXECUTION, 0);
}

static long read_some(long file, unsigned char *bytes, long count)
{
    long found;
    do found = call_system(READ, file, bytes, count);
    while (found == INTERRUPTED);
    return found;
}

static void close_file(long file)
{
    call_system(CLOSE, file, 0, 0);
}

/* --- where the resources are, and what the unit is called ---------------------------------------
   The exporters take a location letter by letter, behind `file:///` at most, and a text that is no
   UTF-8 for a text: a host ends where they find nothing, as in a folder with a blank in its name,
   which a URI writes as %20. */

/* What the exporter reads first, in the resources of every unit: the name of a module, and that
   module (build.py). */
#define FIRST_FILE "/slavemodule.txt"
#define NAME_OF_MODULE "lcmchain_unit_" FMI
#define MODULE "/" NAME_OF_MODULE ".py"

/* Append a text to one of so many characters, as far as there is room in a page. */
static size appended(char *page, size count, const char *text)
{
    while (*text && count < PAGE - 1) page[count++] = *text++;
    page[count] = 0;
    return count;
}

static const char *behind(const char *text, const char *begin)
{
    for (; *begin; text++, begin++)
        if (*text != *begin && (*text | 0x20) != *begin) return 0;
    return text;
}

static int digit(char c)
{
    if (c >= '0' && c <= '9') return c - '0';
    c |= 0x20;
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

/* Open a file of a folder, whose path has so many characters. */
static long opened_in(char *folder, size count, const char *file)
{
    appended(folder, count, file);
    long found = opened(folder);
    folder[count] = 0;
    return found;
}

static int lies_in(char *folder, size count, const char *file)
{
    long found = opened_in(folder, count, file);
    if (found < 0) return 0;
    close_file(found);
    return 1;
}

/* Whether the first line of the first file is the name of the module, and nothing else. */
static int names_the_module(char *folder, size count)
{
    unsigned char line[sizeof NAME_OF_MODULE];
    long file = opened_in(folder, count, FIRST_FILE), found = 0, more = 0;
    if (file < 0) return 0;
    while (found < (long)sizeof line
           && (more = read_some(file, line + found, (long)sizeof line - found)) > 0)
        found += more;
    close_file(file);
    const long length = sizeof line - 1;
    if (more < 0 || found < length) return 0;
    for (long i = 0; i < length; i++)
        if (line[i] != NAME_OF_MODULE[i]) return 0;
    return found == length || line[length] == '\n';
}

/* Whether the module is the one that was built into the unit: of one that Python cannot run, the
   exporter of FMI 3.0 never comes back. The sum is that of Fowler, Noll and Vo (FNV-1a). */
static int is_the_module(char *folder, size count)
{
    unsigned char bytes[512];
    unsigned sum = 2166136261u;
    long file = opened_in(folder, count, MODULE), found;
    if (file < 0) return 0;
    while ((found = read_some(file, bytes, sizeof bytes)) > 0)
        for (long i = 0; i < found; i++) sum = (sum ^ bytes[i]) * 16777619u;
    close_file(file);
    return found == 0 && sum == unit_table[SUM_OF_MODULE];
}

/* Write the folder that a location means to a page; whether it is that of resources. */
static int is_folder_of(char *page, const char *location, int decoded)
{
    size count = 0;
    for (; *location; location++) {
        int high = decoded && *location == '%' ? digit(location[1]) : -1;
        int low = high < 0 ? -1 : digit(location[2]);
        if (count >= PAGE - sizeof MODULE) return 0;
        page[count] = *location;
        if (low >= 0 && high + low > 0) page[count] = (char)(16 * high + low), location += 2;
        count++;
    }
    page[count] = 0;
    return lies_in(page, count, FIRST_FILE) && lies_in(page, count, MODULE);
}

/* Write the folder of the resources to a page: of a path, or of a URI of this machine, whose
   letters some masters do not encode. */
static int find_resources(char *page, const char *location)
{
    const char *path = behind(location, "file:"), *local;
    if (!path) return is_folder_of(page, location, 0);
    if ((local = behind(path, "//localhost/"))) path = local - 1;
    else if ((local = behind(path, "//"))) path = local;
    return is_folder_of(page, path, 1) || is_folder_of(page, path, 0);
}

static int is_utf8(const char *text)
{
    const unsigned char *at = (const unsigned char *)text;
    while (*at) {
        unsigned first = *at++, rest = first < 0x80 ? 0 : first < 0xe0 ? 1 : first < 0xf0 ? 2 : 3;
        if (first >= 0x80 && (first < 0xc2 || first > 0xf4)) return 0;
        /* too long a form, a half of a pair, beyond the last character */
        unsigned lowest = first == 0xe0 ? 0xa0 : first == 0xf0 ? 0x90 : 0x80;
        unsigned highest = first == 0xed ? 0x9f : first == 0xf4 ? 0x8f : 0xbf;
        for (; rest; rest--, at++) {
            if (*at < lowest || *at > highest) return 0;
            lowest = 0x80, highest = 0xbf;
        }
    }
    return 1;
}

#define ALTERED(file) \
    "resources/" file " is not as it was built; unpack the unit again, or build it again"

/* Why no instance can be made of these, or nothing; the folder of the resources, or the reason with
   their location, is written to the page. `percent` is what a logger takes for a %. */
static const char *obstacle_to(char *page, const char *name, const char *token,
                               const char *resources, const char *percent)
{
    if (!name || !token || !resources)
        return "the name, the identifier of the unit or the location of its resources is missing";
    if (!is_utf8(name)) return "the name of the instance is no text in UTF-8";
    if (!is_utf8(resources)) return "the location of the resources is no text in UTF-8";
    if (find_resources(page, resources)) {
        if (!is_utf8(page)) return "the location of the resources is no text in UTF-8";
        size length = appended(page, 0, page);
        if (!names_the_module(page, length)) return ALTERED("slavemodule.txt");
        if (!is_the_module(page, length)) return ALTERED(NAME_OF_MODULE ".py");
        return 0;
    }
    size count = appended(page, 0, "the resources of the unit are not at \"");
    for (; *resources && count < PAGE - 200; resources++) {
        char letter[2] = {*resources, 0};
        count = appended(page, count, *resources == '%' ? percent : letter);
    }
    appended(page, count, "\", or slavemodule.txt or lcmchain_unit_" FMI ".py in it cannot be read; "
                          "hand in the folder resources of the unpacked unit");
    return page;
}

/* What a record holds in both versions. */
enum { STATES = 256 };
struct common {
    void *instance;      /* the exporter's */
    void *environment;   /* the master's */
    int logging;         /* the master wants all texts, not only those of what went wrong */
    unsigned categories; /* bits of those that it wants; 0 = it named none, all */
    int refused;         /* a text of the present call is an error */
    int dead;            /* the exporter has given the instance up: it must not see it again */
    void *sized_state;   /* of which the size was asked last */
    size sized;
    void *states[STATES]; /* the last ones that the master was given and has not freed */
    unsigned next_state;
};

/* Remember a state that the master is given. */
static void given_out(struct common *record, void *state)
{
    record->states[record->next_state++ % STATES] = state;
}

/* Forget one; whether it was known. */
static int taken_back(struct common *record, const void *state)
{
    for (unsigned i = 0; state && i < STATES; i++)
        if (record->states[i] == state) return record->states[i] = 0, 1;
    return 0;
}

static int wants(const struct common *record, int status, const char *category)
{
    if (status == OK && !record->logging) return 0;
    unsigned bit = bit_of(category);
    return !record->categories || !bit || (record->categories & bit);
}

static int choose_categories(struct common *record, int logging, size count,
                             const char *const *names)
{
    unsigned chosen = 0;
    for (size i = 0; i < count; i++) {
        unsigned bit = names && names[i] ? bit_of(names[i]) : 0;
        if (!bit) return 0;
        chosen |= bit;
    }
    record->logging = logging;
    record->categories = chosen;
    return 1;
}

/* The status of a call: an error where Python has told one. */
static int ended(struct common *record, int status)
{
    if (status == FATAL) record->dead = 1;
    return record->refused && status < FATAL ? ERROR : status;
}

/* The time that a unit has reached, in the master's own number where they differ by rounding: a
   master that finds the last successful time behind its own takes a part of the step for done. */
static double in_numbers_of_the_master(double reached, double masters)
{
    double difference = reached - masters, size = reached > 0.0 ? reached : -reached;
    if (difference < 0.0) difference = -difference;
    return difference <= 1e-12 * (size + 1e-3) ? masters : reached;
}

/* Every call begins so: no answer of an instance that there is not, or no more. */
#define BEGIN(record)                                   \
    do {                                                \
        if (!(record)) return ERROR;                    \
        if ((record)->common.dead) return FATAL;        \
        (record)->common.refused = 0;                   \
    } while (0)

#define REFUSE(record, text)                 \
    do {                                     \
        tell(record, ERROR, text);           \
        return ended(&(record)->common, OK); \
    } while (0)

/* The end of an instance, and the choice of what its logger hears; a truth is of this type. */
#define FREED_AND_LOGGED(version, truth)                                                        \
    void original_##version##FreeInstance(void *);                                              \
    EXPORTED void version##FreeInstance(struct record *record)                                  \
    {                                                                                           \
        if (!record) return;                                                                    \
        /* Of an instance that was given up its references have been given back already. */    \
        if (!record->common.dead) original_##version##FreeInstance(record->common.instance);    \
        give_page(record);                                                                      \
    }                                                                                           \
    EXPORTED int version##SetDebugLogging(struct record *record, truth logging, size count,     \
                                          const char *const *names)                             \
    {                                                                                           \
        BEGIN(record);                                                                          \
        if (!choose_categories(&record->common, logging, count, names))                         \
            REFUSE(record, NO_CATEGORY);                                                        \
        return OK;                                                                              \
    }

#define NO_STATE "there is no state"
#define NO_MEMORY "there is no memory for what the call is for"
#define NOT_ITS_SIZE "the memory for a serialized state is not of its size"
#define NO_CATEGORY "a category of log messages that the unit does not have"
#define NO_CO_SIMULATION "the unit is for co-simulation only"
