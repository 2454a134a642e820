"""ELF files: what they need and offer, read without running any of their code.

``ldd`` may run the file that it is asked about, which is no way to look at a unit from elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from elftools.common.exceptions import ELFError
from elftools.elf.elffile import ELFFile


@dataclass(frozen=True)
class SharedObject:
    """What the dynamic linker reads of a program or library.

    Parameters
    ----------
    machine : processor, such as ``x64`` or ``AArch64``, and word length in bits.
    needed : names of the libraries that it names.
    search_path : folders that it names (RPATH, RUNPATH), ``$ORIGIN`` replaced.
    needed_versions : versions of interfaces that it asks of libraries, by library.
    versions : versions of its own interface.
    undefined, defined : names of symbols; weak ones may stay undefined and are not counted.
    interpreter : the dynamic linker of a program, empty for a library.
    """

    path: Path
    machine: tuple[str, int]
    needed: tuple[str, ...]
    search_path: tuple[str, ...]
    needed_versions: dict[str, tuple[str, ...]]
    versions: frozenset[str]
    undefined: frozenset[str]
    defined: frozenset[str]
    interpreter: str


def read_shared_object(path: Path) -> SharedObject | None:
    """Read an ELF file; None for a file of another kind, or one that is damaged."""
    try:
        with path.open("rb") as stream:
            return _read(path, ELFFile(stream))
    except (OSError, ELFError, ValueError, UnicodeDecodeError, AttributeError):
        # what a damaged table raises inside the reader is not foreseeable beyond these
        return None


def _read(path: Path, elf: ELFFile) -> SharedObject:
    needed, search_path = [], []
    dynamic = elf.get_section_by_name(".dynamic")
    for tag in dynamic.iter_tags() if dynamic is not None else ():
        if tag.entry.d_tag == "DT_NEEDED":
            needed.append(tag.needed)
        elif tag.entry.d_tag in ("DT_RPATH", "DT_RUNPATH"):
            text = tag.rpath if tag.entry.d_tag == "DT_RPATH" else tag.runpath
            origin = str(path.resolve().parent)
            search_path += text.replace("${ORIGIN}", origin).replace("$ORIGIN", origin).split(":")
    undefined, defined = set(), set()
    symbols = elf.get_section_by_name(".dynsym")
    for symbol in symbols.iter_symbols() if symbols is not None else ():
        if symbol["st_shndx"] != "SHN_UNDEF":
            defined.add(symbol.name)
        elif symbol["st_info"]["bind"] == "STB_GLOBAL":
            undefined.add(symbol.name)
    program = next((s for s in elf.iter_segments() if s["p_type"] == "PT_INTERP"), None)
    return SharedObject(
        path=path,
        machine=(elf.get_machine_arch(), elf.elfclass),
        needed=tuple(needed),
        search_path=tuple(search_path),
        needed_versions=_needed_versions(elf),
        versions=_versions(elf),
        undefined=frozenset(undefined),
        defined=frozenset(defined),
        interpreter="" if program is None else program.get_interp_name(),
    )


def _needed_versions(elf: ELFFile) -> dict[str, tuple[str, ...]]:
    section = elf.get_section_by_name(".gnu.version_r")
    if section is None:
        return {}
    return {
        need.name: tuple(version.name for version in versions)
        for need, versions in section.iter_versions()
    }


def _versions(elf: ELFFile) -> frozenset[str]:
    section = elf.get_section_by_name(".gnu.version_d")
    if section is None:
        return frozenset()
    return frozenset(next(names).name for _, names in section.iter_versions())
