"""Instances that are run and freed, in a process of their own: `cycles.py FOLDER COUNT OUT_DIR`.

Prints by how much the resident memory grew over COUNT of them [byte], after some first ones.
"""

import os
import sys
from pathlib import Path

from calls import Driver

FIRST = 20


def memory():
    pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


# One library for all, as in a master that runs many: what fmpy keeps of each is not the unit's.
driver = Driver(sys.argv[1])
release = driver.slave.fmi2FreeInstance if driver.version == 2 else driver.slave.fmi3FreeInstance
for cycle in range(FIRST + int(sys.argv[2])):
    if cycle == FIRST:
        before = memory()
    if cycle:
        driver.slave.instantiate(**driver._logging())
    driver.set_up()
    driver.put("text", "out_dir", sys.argv[3])
    driver.enter()
    driver.leave()
    driver.step()
    driver.terminate()
    release(driver.slave.component)
print(memory() - before)
