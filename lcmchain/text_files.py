"""Reading of text files that users write: UTF-8, with or without a byte-order mark."""

from __future__ import annotations

import codecs
from pathlib import Path

from lcmchain.errors import InputError

# The marks of UTF-32 begin like those of UTF-16, so they stand first.
_OTHER_ENCODINGS = (
    (codecs.BOM_UTF32_LE, "UTF-32"),
    (codecs.BOM_UTF32_BE, "UTF-32"),
    (codecs.BOM_UTF16_LE, "UTF-16"),
    (codecs.BOM_UTF16_BE, "UTF-16"),
)


def decode_text(content: bytes, path: Path) -> str:
    """Return the text of a file without its byte-order mark; line ends stay as they are.

    Raises
    ------
    InputError : the bytes are not UTF-8; names the encoding where its mark tells it, else line and
        column of the first wrong byte.
    """
    for mark, encoding in _OTHER_ENCODINGS:
        if content.startswith(mark):
            raise InputError(f"is {encoding} text; save the file as UTF-8", file=path)
    zero = content.find(b"\0")
    if zero >= 0:  # before decoding: UTF-16 without a mark is often not valid UTF-8 either
        line = content[:zero].count(b"\n") + 1
        raise InputError(
            f"holds a zero byte in line {line}, as UTF-16 text "
            "without a mark does; save the file as UTF-8",
            file=path,
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # the decoder counts from behind a mark, which it drops
        start = error.start + len(content) - len(error.object)
        raise InputError(_wrong_byte(content, start), file=path) from None


def _wrong_byte(content: bytes, start: int) -> str:
    byte = content[start]
    before = content[:start].decode("utf-8-sig")
    # undefined in Windows-1252: 81, 8D, 8F, 90, 9D
    shown = bytes([byte]).decode("cp1252", errors="ignore")
    guess = f' (in Windows-1252 it is "{shown}")' if shown else ""
    return (
        f"is not UTF-8 text: byte 0x{byte:02X} at {_place(before)}{guess}; save the file as UTF-8"
    )


def _place(before: str) -> str:
    """Say where the character behind a text stands, counted from 1 as editors do."""
    lines = before.split("\n")
    return f"line {len(lines)}, column {len(lines[-1]) + 1}"
