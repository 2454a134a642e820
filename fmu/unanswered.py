"""Functions of FMI 3.0 that pythonfmu3 does not have, and that end the host: they answer instead.

pythonfmu3 leaves these to a C++ exception, which no master catches. A unit of lcmchain has nothing
that they could be asked for (no clocks, no binaries, no numbers but of 64 bits, no dependencies of
single values; co-simulation only), so an error is the answer that the standard foresees. In the
copy of the library that goes into a unit, their first bytes become that answer.
"""

from __future__ import annotations

import io

from elftools.common.exceptions import ELFError
from elftools.elf.elffile import ELFFile

_ABSENT = ("Float32", "Int8", "Int16", "UInt8", "UInt16", "UInt32", "Clock", "Binary")
_OF_CLOCKS = ("IntervalDecimal", "IntervalFraction", "ShiftDecimal", "ShiftFraction")

#: They answer with an error (fmi3Error).
WITH_ERROR = frozenset(
    [f"fmi3{verb}{what}" for verb in ("Get", "Set") for what in (*_ABSENT, *_OF_CLOCKS)]
    + ["fmi3GetNumberOfVariableDependencies", "fmi3GetVariableDependencies"]
    + ["fmi3GetAdjointDerivative", "fmi3EvaluateDiscreteStates", "fmi3ActivateModelPartition"]
)
#: They answer with no instance.
WITH_NOTHING = frozenset(["fmi3InstantiateModelExchange", "fmi3InstantiateScheduledExecution"])

# x86-64, the same for all calling conventions: mov eax, 3; ret and xor eax, eax; ret.
_ERROR, _NOTHING = b"\xb8\x03\x00\x00\x00\xc3", b"\x31\xc0\xc3"


def answered(library: bytes) -> bytes:
    """Return a shared library of Linux on x86-64 whose functions above answer; others unchanged."""
    try:
        file = ELFFile(io.BytesIO(library))
        symbols = file.get_section_by_name(".dynsym")
    except ELFError:
        return library
    if symbols is None or file["e_machine"] != "EM_X86_64":
        return library
    changed = bytearray(library)
    for symbol in symbols.iter_symbols():
        code = _answer(symbol.name)
        if code and symbol["st_shndx"] != "SHN_UNDEF" and symbol["st_size"] >= len(code):
            section = file.get_section(symbol["st_shndx"])
            place = symbol["st_value"] - section["sh_addr"] + section["sh_offset"]
            changed[place : place + len(code)] = code
    return bytes(changed)


def _answer(name: str) -> bytes:
    if name in WITH_ERROR:
        return _ERROR
    return _NOTHING if name in WITH_NOTHING else b""
