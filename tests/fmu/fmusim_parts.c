/* What fmusim takes from other libraries, as far as co-simulation needs it (fmusim.py). */

#include <stdio.h>
#include <stdlib.h>

#include "FMICVode.h"
#include "miniunzip.h"

/* miniunz -x -o ARCHIVE -d FOLDER, in place of minizip's: Python unpacks it. */
int miniunz_main(int argc, const char *argv[]) {
    char command[8192];
    if (argc != 6) return 1;
    snprintf(command, sizeof command, "LD_PRELOAD= '%s' -m zipfile -e '%s' '%s'", PYTHON, argv[3],
             argv[5]);
    return system(command);
}

/* The solver CVODE integrates model exchange: these units have no continuous states. */
FMISolver *FMICVodeCreate(const FMISolverParameters *parameters) {
    (void)parameters;
    return NULL;
}

void FMICVodeFree(FMISolver *solver) { (void)solver; }

FMISolverStatus FMICVodeStep(FMISolver *solver, double next, double *reached, bool *event) {
    (void)solver, (void)next, (void)reached, (void)event;
    return FMISolverError;
}

FMISolverStatus FMICVodeReset(FMISolver *solver, double time) {
    (void)solver, (void)time;
    return FMISolverError;
}
