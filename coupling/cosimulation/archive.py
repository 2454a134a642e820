"""Archives and XML from elsewhere: unpacked and parsed without trusting them.

An FMU and an SSP are ZIP archives. Nothing is written outside of the folder, no link and no device
is made, the bytes written are counted, and XML that declares entities is not parsed at all.
"""

from __future__ import annotations

import errno
import hashlib
import re
import shutil
import stat
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree
from xml.parsers import expat

from lcmchain.errors import InputError, shortened

#: Bytes that are copied at a time.
CHUNK = 1 << 20


@dataclass(frozen=True)
class Limits:
    """How much an archive may hold.

    Parameters
    ----------
    entries : number of files and folders.
    total : bytes of all files unpacked.
    xml : bytes of one XML document.
    depth : nesting of its elements, and of folders.
    """

    entries: int = 20_000
    total: int = 4 << 30
    xml: int = 256 << 20
    depth: int = 100


LIMITS = Limits()


def unpack(path: Path | str, folder: Path | str, limits: Limits = LIMITS) -> Path:
    """Unpack an archive into a new or empty folder; an error leaves nothing in it.

    Raises
    ------
    InputError : no ZIP archive, damaged or encrypted, beyond the limits, or an entry that is a link
        or would lie outside of the folder; names the archive and the entry.
    """
    path, folder = Path(path), Path(folder)
    if folder.exists() and any(folder.iterdir()):
        raise InputError("an archive is unpacked into an empty folder only", file=folder)
    is_new = not folder.exists()
    with _opened(path) as archive:
        entries = _checked(archive, path, limits)
        folder.mkdir(parents=True, exist_ok=True)
        try:
            _write(archive, entries, folder, path, limits)
        except BaseException:
            for made in folder.iterdir():
                shutil.rmtree(made) if made.is_dir() else made.unlink()
            if is_new:
                folder.rmdir()
            raise
    return folder


def read_member(path: Path | str, name: str, limits: Limits = LIMITS) -> bytes:
    """Return the content of one file of an archive.

    Raises
    ------
    InputError : as for :func:`unpack`, or there is no such file; more than ``limits.xml`` bytes.
    """
    path = Path(path)
    with _opened(path) as archive:
        entries = {entry.filename: entry for entry in _checked(archive, path, limits)}
        entry = entries.get(name)
        if entry is None or entry.is_dir():
            raise InputError(f'holds no file "{shortened(name)}"', file=path)
        if entry.file_size > limits.xml:
            raise InputError(
                f'its file "{shortened(name)}" holds {entry.file_size:,} bytes; more than '
                f"{limits.xml:,} are not read",
                file=path,
            )
        return b"".join(_chunks(archive, entry, path))


def read_xml(content: bytes, file: Path | str, limits: Limits = LIMITS) -> ElementTree.Element:
    """Parse an XML document that declares no entities.

    Parameters
    ----------
    content : the document.
    file : where it comes from, for messages.

    Raises
    ------
    InputError : it is not well-formed, has a document type declaration (which may define entities
        that expand without end or read files), or is larger or deeper than the limits.
    """
    if len(content) > limits.xml:
        raise InputError(
            f"holds {len(content):,} bytes; more than {limits.xml:,} are not read", file=file
        )
    _require_plain(content, file, limits)
    try:
        return ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(
            f"is not well-formed XML: {error}{_undeclared(content, str(error))}", file=file
        ) from None


def _undeclared(content: bytes, error: str) -> str:
    """Return advice where a document uses a prefix without its namespace; else an empty text."""
    if "unbound prefix" not in error:
        return ""
    used = dict.fromkeys(re.findall(rb"<([A-Za-z][\w.-]*):", content))
    declared = set(re.findall(rb"xmlns:([\w.-]+)\s*=", content))
    missing = [name.decode() for name in used if name not in declared]
    if not missing:
        return ""
    return f'; declare the namespace of the prefix "{missing[0]}" (xmlns:{missing[0]}="...")'


def sha256_of(path: Path | str) -> str:
    """Return the hash of a file's content."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


# --- ZIP ------------------------------------------------------------------------------------------


def _opened(path: Path) -> zipfile.ZipFile:
    if path.is_dir():
        raise InputError("is a folder; an archive (ZIP) is needed", file=path)
    try:
        return zipfile.ZipFile(path)
    except FileNotFoundError:
        raise InputError("there is no such file", file=path) from None
    except (zipfile.BadZipFile, NotImplementedError, ValueError, EOFError) as error:
        raise InputError(f"is no ZIP archive, or a damaged one ({error})", file=path) from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", file=path) from None


def _checked(archive: zipfile.ZipFile, path: Path, limits: Limits) -> list[zipfile.ZipInfo]:
    """Return the entries; refuse them by name and size before anything is unpacked."""
    entries = archive.infolist()
    if len(entries) > limits.entries:
        raise InputError(
            f"holds {len(entries):,} entries; more than {limits.entries:,} are not unpacked",
            file=path,
        )
    total = sum(entry.file_size for entry in entries)
    if total > limits.total:
        raise InputError(
            f"would unpack to {total:,} bytes; more than {limits.total:,} are refused", file=path
        )
    seen: set[PurePosixPath] = set()
    files: set[PurePosixPath] = set()
    for entry in entries:
        reason = _refusal(entry, limits)
        inner = PurePosixPath(entry.filename)
        if reason is None and not entry.is_dir():
            reason = "stands in it twice" if inner in seen else None
            files.add(inner)
        seen.add(inner)
        if reason is not None:
            raise _refused(entry, reason, path)
    for entry in entries:
        if files.intersection(PurePosixPath(entry.filename).parents):
            raise _refused(entry, "lies in what is a file of the archive too", path)
    return entries


def _refusal(entry: zipfile.ZipInfo, limits: Limits) -> str | None:
    """Return why an entry must not be unpacked, None where it may."""
    name = entry.orig_filename
    inner = PurePosixPath(entry.filename)
    if "\0" in name or "\\" in name:
        return "has a name with characters that no path in an archive has"
    if inner.is_absolute() or ".." in inner.parts or ":" in (inner.parts or ("",))[0]:
        return "would lie outside of the folder"
    if not inner.parts:
        return "has no name"
    if len(inner.parts) > limits.depth:
        return f"lies more than {limits.depth} folders deep"
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        return "is a link" if kind == stat.S_IFLNK else "is no file and no folder"
    if entry.flag_bits & 0x1:
        return "is encrypted"
    return None


def _refused(entry: zipfile.ZipInfo, reason: str, path: Path) -> InputError:
    name = shortened(entry.orig_filename.encode("unicode_escape").decode("ascii"))
    return InputError(
        f'the archive is not unpacked, because its entry "{name}" {reason}; ask for a sound one '
        "where it comes from",
        file=path,
    )


#: Errors of a folder that takes no more files, whatever their names.
_NO_ROOM = {errno.ENOSPC, errno.EROFS, errno.EACCES, errno.EFBIG, errno.EIO} | {
    getattr(errno, "EDQUOT", errno.ENOSPC)
}


def _write(
    archive: zipfile.ZipFile,
    entries: list[zipfile.ZipInfo],
    folder: Path,
    path: Path,
    limits: Limits,
) -> None:
    left = limits.total
    for entry in entries:
        target = folder / entry.filename
        try:
            if entry.is_dir():
                target.mkdir(parents=True, exist_ok=True)
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            with open(target, "xb") as file:
                for chunk in _chunks(archive, entry, path):
                    left -= len(chunk)
                    if left < 0:  # the sizes that it states are wrong
                        raise InputError(
                            f"unpacks to more than {limits.total:,} bytes, which are refused",
                            file=path,
                        )
                    file.write(chunk)
        except OSError as error:
            if error.errno in _NO_ROOM:
                raise InputError(
                    f"cannot be unpacked into {folder} ({error.strerror}); free some space there, "
                    "or name another folder for temporary files by the variable TMPDIR",
                    file=path,
                ) from None
            raise _refused(entry, f"cannot be written ({error.strerror or error})", path) from None


def _chunks(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, path: Path) -> Iterator[bytes]:
    try:
        with archive.open(entry) as member:
            while chunk := member.read(CHUNK):
                yield chunk
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise _refused(entry, f"is damaged or packed in an unknown way ({error})", path) from None


# --- XML ------------------------------------------------------------------------------------------


class _Refused(Exception):
    """A document that is not parsed."""


def _require_plain(content: bytes, file: Path | str, limits: Limits) -> None:
    """Go through a document without building anything; stop at the first thing that is refused."""
    parser = expat.ParserCreate()
    depth = 0

    def declaration(*_: object) -> None:
        raise _Refused(
            "has a document type declaration, through which entities can expand without end or "
            "read files; it is not parsed"
        )

    def begin(*_: object) -> None:
        nonlocal depth
        depth += 1
        if depth > limits.depth:
            raise _Refused(f"nests its elements more than {limits.depth} deep")

    def end(*_: object) -> None:
        nonlocal depth
        depth -= 1

    parser.StartDoctypeDeclHandler = declaration
    parser.EntityDeclHandler = declaration
    parser.StartElementHandler = begin
    parser.EndElementHandler = end
    try:
        parser.Parse(content, True)
    except _Refused as refused:
        raise InputError(str(refused), file=file) from None
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise InputError(f"is not well-formed XML: {error}", file=file) from None
