"""Put the guard into the exporter's library: it takes the places of the functions of FMI.

``guard.h`` says what the guard is for. Its object is placed behind the library as a segment of its
own, which takes the place of a note (the build id) in the table of segments. The names of the
functions then mean those of the guard, which call the exporter's. Every function that takes an
instance must be the guard's, since a master holds no instance of the exporter any more.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import NamedTuple

from elftools.common.exceptions import ELFError
from elftools.elf.elffile import ELFFile

from lcmchain.fmu.variables import TIME, Kind, Layout, Variable

#: Functions of the standards that take no instance.
FREE_OF_INSTANCES = {"fmi2GetVersion", "fmi2GetTypesPlatform", "fmi3GetVersion"}

_PAGE = 4096
_ALLOCATED = 2  # flag of a section that is in memory at run time
_RELATIVE = {2, 4}  # R_X86_64_PC32 and R_X86_64_PLT32: 32 bits relative to their place
_PT_LOAD = 1
_READ_AND_RUN = 5
_KINDS = list(Kind)  # in the order of the enumeration in guard.h


class LinkError(Exception):
    """The guard does not fit to the library: the exporter is another than it was made for."""


class _Guard(NamedTuple):
    """The guard at the address where it will lie."""

    content: bytes
    functions: dict[str, tuple[int, int]]  # name to address and size


def guarded(library: bytes, fmi: int, variables: Sequence[Variable], module: bytes) -> bytes:
    """Return a shared library of Linux on x86-64 with the guard; others unchanged.

    Parameters
    ----------
    library : of the exporter. fmi : version of the standard. variables : of the unit.
    module : content of the unit's entry file, without which the guard makes no instance.

    Raises
    ------
    LinkError : the library lacks a function of the exporter, or has one too many.
    """
    try:
        file = ELFFile(io.BytesIO(library))
        symbols = file.get_section_by_name(".dynsym")
    except ELFError:
        return library
    if symbols is None or file["e_machine"] != "EM_X86_64":
        return library
    originals = {
        symbol.name: symbol["st_value"]
        for symbol in symbols.iter_symbols()
        if symbol.name.startswith(f"fmi{fmi}") and symbol["st_shndx"] != "SHN_UNDEF"
    }
    loaded = [segment for segment in file.iter_segments() if segment["p_type"] == "PT_LOAD"]
    end = max(segment["p_vaddr"] + segment["p_memsz"] for segment in loaded)
    address = -(-end // _PAGE) * _PAGE
    place = -(-len(library) // _PAGE) * _PAGE
    if originals and address in (segment["p_vaddr"] for segment in loaded):
        raise LinkError("there is a segment where the guard belongs")
    guard = _placed(fmi, address, originals, unit_table(variables, module, arrays=fmi == 3))
    left = set(originals) - set(guard.functions) - FREE_OF_INSTANCES
    if left:
        raise LinkError(f"the guard has no {', '.join(sorted(left))}")
    changed = bytearray(library.ljust(place, b"\0") + guard.content)
    _add_segment(file, changed, place, address, len(guard.content))
    for index, symbol in enumerate(symbols.iter_symbols()):
        if symbol.name in originals and symbol.name in guard.functions:
            entry = symbols["sh_offset"] + index * symbols["sh_entsize"]
            changed[entry + 8 : entry + 24] = struct.pack("<QQ", *guard.functions[symbol.name])
    return bytes(changed)


def unit_table(variables: Sequence[Variable], module: bytes, *, arrays: bool) -> bytes:
    """Return what the guard knows of a unit: its references with their values, and its module."""
    layout = Layout(variables, arrays=arrays)
    names = [variable.name for variable in variables]
    time = layout.slots[TIME.name].start if not arrays else names.index(TIME.name)
    kinds = [4 * one.count + _KINDS.index(one.kind) for one in variables] if arrays else []
    return struct.pack(f"<{3 + len(kinds)}I", len(kinds), time, _sum_of(module), *kinds)


def _sum_of(content: bytes) -> int:
    """Return the sum by which the guard knows a file: FNV-1a with 32 bits, as in ``guard.h``."""
    found = 2166136261
    for byte in content:
        found = (found ^ byte) * 16777619 % 2**32
    return found


def guard_object(fmi: int) -> ELFFile:
    """Return the compiled guard of a version of the standard."""
    content = (files(__package__) / f"fmi{fmi}.o").read_bytes()
    return ELFFile(io.BytesIO(content))


def _placed(fmi: int, address: int, originals: Mapping[str, int], table: bytes) -> _Guard:
    """Place the guard at an address and let it call the exporter's functions."""
    file = guard_object(fmi)
    content = bytearray(table)
    places: dict[int, int] = {}
    for index, section in enumerate(file.iter_sections()):
        if not section["sh_flags"] & _ALLOCATED or section.name.startswith(".comment"):
            continue
        if section["sh_size"] and section.name in (".data", ".bss"):
            raise LinkError("the guard has data that change")
        content += bytes(-len(content) % max(section["sh_addralign"], 16))
        places[index] = address + len(content)
        content += section.data()
    known: dict[int, int] = {}
    functions = {}
    for index, symbol in enumerate(file.get_section_by_name(".symtab").iter_symbols()):
        name, where = symbol.name, symbol["st_shndx"]
        if name == "unit_table":
            known[index] = address
        elif name.startswith("original_"):
            if name.removeprefix("original_") not in originals:
                raise LinkError(f"the exporter has no {name.removeprefix('original_')}")
            known[index] = originals[name.removeprefix("original_")]
        elif where in places:
            known[index] = places[where] + symbol["st_value"]
            if symbol["st_info"]["bind"] == "STB_GLOBAL":
                functions[name] = known[index], symbol["st_size"]
    text = next(i for i, s in enumerate(file.iter_sections()) if s.name == ".text")
    for relocation in file.get_section_by_name(".rela.text").iter_relocations():
        if relocation["r_info_type"] not in _RELATIVE or relocation["r_info_sym"] not in known:
            raise LinkError("the guard asks for something that is not there")
        here = places[text] + relocation["r_offset"]
        value = known[relocation["r_info_sym"]] + relocation["r_addend"] - here
        struct.pack_into("<i", content, here - address, value)
    return _Guard(bytes(content), functions)


def _add_segment(file: ELFFile, changed: bytearray, place: int, address: int, size: int) -> None:
    """Turn a note behind all segments that are loaded into one more of these."""
    kinds = [segment["p_type"] for segment in file.iter_segments()]
    last = max(index for index, kind in enumerate(kinds) if kind == "PT_LOAD")
    notes = [index for index, kind in enumerate(kinds) if kind == "PT_NOTE" and index > last]
    if not notes:
        raise LinkError("the library has no note that can be given up")
    header = file["e_phoff"] + notes[-1] * file["e_phentsize"]
    struct.pack_into(
        "<IIQQQQQQ", changed, header,
        _PT_LOAD, _READ_AND_RUN, place, address, address, size, size, _PAGE,
    )  # fmt: skip
