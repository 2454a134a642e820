"""Loads a unit in a process of its own: `python exporter_pointer.py FOLDER`.

Prints what the exporter's static pointer to its interpreter holds while the unit is loaded, and at
the very end of the interpreter, before the destructors of C++ run.
"""

import atexit
import ctypes
import sys
from pathlib import Path

from elftools.elf.elffile import ELFFile


def address_of_the_pointer(folder):
    (binary,) = Path(folder).glob("binaries/*linux*/*.so")
    lines = Path("/proc/self/maps").read_text().splitlines()
    base = next(line.split("-")[0] for line in lines if line.endswith(binary.name))
    with binary.open("rb") as file:
        symbols = ELFFile(file).get_section_by_name(".symtab").iter_symbols()
        offset = next(s["st_value"] for s in symbols if s.name.endswith("N_17pyStateE"))
    return int(base, 16) + offset


def tell():
    print(ctypes.c_void_p.from_address(address_of_the_pointer(sys.argv[1])).value)


atexit.register(tell)  # what is registered first runs last

from calls import Driver  # noqa: E402

driver = Driver(sys.argv[1])
driver.free()
tell()
