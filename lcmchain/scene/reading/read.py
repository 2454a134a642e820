"""Read a scene file: text within limits, files it names, validation, and what was used.

A list that stands in a file of its own becomes an entry of the scene, and an override of its text:
a result holds the scene with all numbers, whatever becomes of the file.
"""

from __future__ import annotations

import copy
import hashlib
import json
import os
import re
import stat
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from lcmchain.errors import InputError, shortened
from lcmchain.quantities.entry_types import FROM_FILE, AbsentMeans, OrFile
from lcmchain.scene.presets import PRESETS
from lcmchain.scene.reading.explain import (
    MOST_PROBLEMS,
    Location,
    Problem,
    dotted,
    field_at,
    key_text,
    named_files,
    problems_of,
    value_at,
)
from lcmchain.scene.reading.overrides import TomlTable, apply_overrides
from lcmchain.scene.scene import Scene, SceneSource
from lcmchain.text_files import decode_text
from lcmchain.tools.motion import GuidedMotion

#: Longest problem, and longest list of them [characters], that a message shows.
LONGEST_PROBLEM = 400
LONGEST_LIST = 1800

#: What stands before an override in the text of a scene that results hold.
OVERRIDE = "# --set "

#: What came through pipes without a name, as <(...) of a shell, by where they are. They can be read
#: once, while commands look at a scene several times.
_OF_PIPES: dict[str, bytes] = {}


def read_scene(path: str | Path, overrides: Sequence[str] | str = ()) -> Scene:
    """Read and validate a scene file.

    Parameters
    ----------
    path : TOML file; file names in it are relative to its folder.
    overrides : ``key=value`` texts, or a single one, that replace or add entries, see
        :func:`lcmchain.scene.reading.overrides.apply_overrides`.

    Raises
    ------
    InputError : the file cannot be read, is not TOML, or any entry is wrong; all wrong entries are
        named in one message.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError("is a folder; name the scene file in it, such as scene.toml", file=path)
    text = read_text(path)
    return scene_from_text(text, path, overrides)


def read_text(path: Path) -> str:
    """Read a scene file, or a file of the same form.

    Raises
    ------
    InputError : it is absent or unreadable, or far too large.
    """
    try:
        content = _bytes_of(path)
    except FileNotFoundError:
        hint = "; /dev/stdin is the standard input" if str(path) == "-" else ""
        raise InputError(f"there is no such scene file{hint}", file=path) from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None
    if len(content) > MOST_BYTES:
        raise InputError(
            f"holds more than {MOST_BYTES // 1_000_000} MB, which no scene file does", file=path
        )
    return decode_text(content, path)


def _bytes_of(path: Path) -> bytes:
    """Return the first ``MOST_BYTES + 1`` bytes of a file, and of a nameless pipe each time."""
    pipe = os.path.realpath(path) if path.is_fifo() else ""
    nameless = pipe and not os.path.exists(pipe)
    if nameless and pipe in _OF_PIPES:
        return _OF_PIPES[pipe]
    with open(path, "rb") as opened:
        content = opened.read(MOST_BYTES + 1)
    if nameless:
        _OF_PIPES[pipe] = content
    return content


def is_pipe(path: Path) -> bool:
    """Tell whether a path leads to a pipe or terminal, as /dev/stdin or <(...) of a shell."""
    return path.is_fifo() or path.is_char_device()


def directory_of(path: Path | None) -> Path:
    """Return the folder in which file names of a scene or case are looked up.

    One that comes through a pipe lies in no folder.
    """
    if path is None or is_pipe(path):
        return Path.cwd()
    return path.resolve().parent


def scene_from_text(
    text: str, path: str | Path | None = None, overrides: Sequence[str] | str = ()
) -> Scene:
    """Validate the text of a scene file.

    Parameters
    ----------
    text : TOML.
    path : the file that it came from; its folder is where file names in the scene are looked up
        (the current folder where None, or a pipe).
    overrides : as in :func:`read_scene`.

    Raises
    ------
    InputError : as in :func:`read_scene`.
    """
    path = None if path is None else Path(path)
    directory = directory_of(path)
    data = parse_toml(text, path)
    require_within_limits(data, path)
    overrides = (overrides,) if isinstance(overrides, str) and overrides else overrides
    if overrides:
        apply_overrides(data, overrides)
        require_within_limits(data, path)
    expanded, of_files = _with_tables(data, directory)
    try:
        context = FROM_FILE | {"directory": directory}
        scene = Scene.model_validate(copy.deepcopy(expanded), context=context)
    except ValidationError as error:
        # Files are looked up even so, to report everything that is wrong at once.
        missing = _missing_files(data, directory)
        problems = problems_of(error, expanded) + missing
        unexplained = max(error.error_count() - MOST_PROBLEMS, 0)
        raise input_error(problems, path, unexplained=unexplained) from None
    missing = _missing_files(data, directory)
    if missing:
        raise input_error(missing, path)
    full_text = text
    if overrides:
        full_text = text.rstrip("\n") + "\n\n# Overrides:\n"
        full_text += "".join(f"{OVERRIDE}{' '.join(item.splitlines())}\n" for item in overrides)
    if of_files:
        full_text = full_text.rstrip("\n") + "\n\n# From files that the scene names:\n"
        full_text += "".join(f"{OVERRIDE}{item}\n" for item in of_files)
    given, defaulted = _used_values(scene, expanded)
    scene._source = SceneSource(
        path=path,
        directory=directory,
        text=full_text,
        sha256=hashlib.sha256(full_text.encode()).hexdigest(),
        given=given,
        defaulted=defaulted,
        files=[(dotted(location), value) for location, value in named_files(data)],
    )
    return scene


def parse_toml(text: str, path: Path | None) -> TomlTable:
    """Parse the text of a scene file, or of a file of the same form.

    Raises
    ------
    InputError : it is not TOML.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        message = f"is not valid TOML: {error}"
        match = re.search(r"at line (\d+)", str(error))
        if match is not None:
            line = shortened(text.split("\n")[int(match[1]) - 1].strip())
            message += f"\n  {match[1]} | {line}"
            if re.fullmatch(r"[\w.\-\"]+\s*=\s*[+-]?[\d.]+(e[+-]?\d+)?\s*[A-Za-zµ°].*", line):
                message += '\n  values with units stand in quotes, for example "5 mm"'
        raise InputError(message, file=_document_name(path)) from None
    except RecursionError:
        raise InputError("has brackets nested far too deeply", file=_document_name(path)) from None
    except ValueError as error:  # a number of thousands of digits
        raise InputError(f"is not valid TOML: {error}", file=_document_name(path)) from None


def require_within_limits(data: TomlTable, path: Path | None) -> None:
    """Refuse a document that is nested or filled beyond any use."""
    problem = _beyond_limits(data)
    if problem is not None:
        raise input_error([problem], path)


def _document_name(path: Path | None) -> str:
    return "scene text" if path is None else str(path)


def input_error(problems: list[Problem], path: Path | None, *, unexplained: int = 0) -> InputError:
    """Return the error that names all problems of a document."""
    file = None if path is None else str(path)
    if len(problems) == 1:
        key = problems[0].key or None
        place = f" [{file}]" if file and key else ""
        return InputError(problems[0].message + place, key=key, file=file)
    lines: list[str] = []
    for problem in problems:
        line = f"\n  {shortened(str(problem), LONGEST_PROBLEM)}"
        if sum(map(len, lines)) + len(line) > LONGEST_LIST:
            break
        lines.append(line)
    count = len(problems) + unexplained
    if len(lines) < count:
        lines.append(f"\n  and {count - len(lines):,} more")
    return InputError(f"has {count:,} errors:{''.join(lines)}", file=_document_name(path))


def _missing_files(data: TomlTable, directory: Path) -> list[Problem]:
    """Name the files that a scene points to and that are not there."""
    problems = []
    for location, value in named_files(data):
        key = key_text(location, data)
        found = _kind_of(directory / value)
        if found == "absent":
            problems.append(
                Problem(
                    key,
                    f'there is no file "{shortened(value)}" in {directory}; file names are '
                    "relative to the scene file",
                )
            )
        elif found != "file":
            problems.append(Problem(key, f'"{shortened(value)}" is {found}'))
    return problems


def _kind_of(path: Path) -> str:
    """Return ``"file"``, or what a path is instead."""
    try:
        status = path.stat()
    except (OSError, ValueError):  # absent, not to be reached, or no name that a file can have
        return "absent"
    if not stat.S_ISREG(status.st_mode):
        return "a folder" if stat.S_ISDIR(status.st_mode) else "not a file"
    return "file" if status.st_size else "empty"


# --- lists in files of their own ------------------------------------------------------------------


def _with_tables(data: TomlTable, directory: Path) -> tuple[TomlTable, list[str]]:
    """Return a copy of a document with the contents of these files, and these as overrides.

    A file that is not there is left out: who reads the scene tells of all files that are missing.

    Raises
    ------
    InputError : a file does not hold what it should; names key, file and line.
    """
    expanded, overrides = copy.deepcopy(data), []
    for location, value in list(named_files(data)):
        entry = field_at(location, data)
        marks = [own for own in entry.metadata if isinstance(own, OrFile)] if entry else []
        if not marks:
            continue
        holder: Any = expanded
        for step in location[:-1]:
            holder = holder[step]
        path = directory / value
        if not _is_file(path):
            del holder[location[-1]]
            continue
        holder[location[-1]] = content = _content(marks[0], path, location, data)
        overrides.append(f"{dotted(location)}={_as_toml(content)}")
    return expanded, overrides


def _content(mark: OrFile, path: Path, location: Location, data: TomlTable) -> Any:
    try:
        return mark.read(path)
    except InputError as error:
        text = f"{error.file}: {error.message}"
        raise InputError(text, key=key_text(location, data), file=error.file) from None


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # no name that a file can have
        return False


def _as_toml(content: object) -> str:
    """Write lists, tables, texts and numbers as a TOML value on one line."""
    if isinstance(content, dict):
        return "{" + ", ".join(f"{key} = {_as_toml(own)}" for key, own in content.items()) + "}"
    if isinstance(content, list):
        return "[" + ", ".join(map(_as_toml, content)) + "]"
    return json.dumps(content)


# --- limits, far above any use: what is larger was not written for a scene ------------------------


MOST_BYTES = 2_000_000
MOST_LEVELS = 20
LONGEST_KEY = 100
LONGEST_TEXT = 200_000
#: TOML's own range of whole numbers.
LARGEST_WHOLE_NUMBER = 2**63


def _beyond_limits(data: TomlTable) -> Problem | None:
    """Return the first entry of a parsed document that is nested too deeply or far too long."""
    waiting: list[tuple[tuple[str | int, ...], Any]] = [((), data)]
    while waiting:
        location, value = waiting.pop()
        inner: list[tuple[str | int, Any]] = []
        complaint = None
        if isinstance(value, dict):
            inner = list(value.items())
            longest = max(value, key=len, default="")
            if len(longest) > LONGEST_KEY:
                complaint = (
                    f'has a key of {len(longest):,} characters, "{shortened(longest)}"; at most '
                    f"{LONGEST_KEY} are read"
                )
        elif isinstance(value, list):
            inner = list(enumerate(value))
        else:
            complaint = _complaint(value)
        if inner and len(location) == MOST_LEVELS:
            complaint = f"is nested more than {MOST_LEVELS} levels deep; no entry of a scene is"
        if complaint:
            return Problem(shortened(key_text(location, data)), complaint)
        waiting += [((*location, step), entry) for step, entry in inner]
    return None


def _complaint(value: object) -> str | None:
    if isinstance(value, str):
        if len(value) > LONGEST_TEXT:
            return f"is a text of {len(value):,} characters; at most {LONGEST_TEXT:,} are read"
        if not value.isprintable() and any(map(_is_unwritable, value)):
            return "holds characters that cannot be written to a file"
    elif isinstance(value, int) and not -LARGEST_WHOLE_NUMBER <= value < LARGEST_WHOLE_NUMBER:
        return "is a whole number too large to compute with"
    return None


def _is_unwritable(character: str) -> bool:
    """Whether a character is half of a pair (from a command line that is no text), or a zero."""
    return character == "\0" or "\ud800" <= character <= "\udfff"


# --- what was given and what was defaulted --------------------------------------------------------


def _used_values(
    scene: Scene, data: TomlTable
) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    given: list[tuple[str, str]] = []
    defaulted: list[tuple[str, str]] = []
    if isinstance(data.get("element"), str):
        data = data | {"element": {"type": data["element"]}}
    preset = _preset_values(scene)
    for key, raw_path, text in _leaves(scene, (), ()):
        value = value_at(raw_path, data, _ABSENT)
        from_preset = value_at(raw_path, preset, _ABSENT)
        if value is not _ABSENT:
            given.append((key, _value_text(value)))
        elif from_preset is not _ABSENT:
            # a table within a material's names no preset of its own
            within = ((*raw_path[:end], "preset") for end in range(len(raw_path) - 1, 0, -1))
            owner = next(
                o for path in within if (o := value_at(path, preset, _ABSENT)) is not _ABSENT
            )
            defaulted.append((key, f"{_value_text(from_preset)} (preset {owner})"))
        elif text:
            defaulted.append((key, _resolved_text(scene, key, text)))
    return given, defaulted


def _preset_values(scene: Scene) -> dict[str, Any]:
    """Return what presets give, as tables of a scene file, each with the name of its preset."""
    values: dict[str, Any] = {}
    name = getattr(scene.material, "preset", None)
    if name:
        values["material"] = {**PRESETS[name], "preset": name}
    values["materials"] = {
        name: {**PRESETS[preset], "preset": preset}
        for name, material in scene.materials.items()
        if (preset := getattr(material, "preset", None))
    }
    if scene.infiltration is not None:
        values["infiltration"] = scene.infiltration.preset_values()
    stages = [
        {
            stage: table.preset_values()
            for stage in ("structure", "infiltration")
            if (table := getattr(target, stage)) is not None
        }
        for target in scene.mapping
    ]
    if any(stages):
        values["mapping"] = stages
    return values


def _leaves(
    model: BaseModel, key: tuple[str, ...], path: tuple[str | int, ...]
) -> Iterator[tuple[str, tuple[str | int, ...], str]]:
    """Walk the entries of a scene: dotted key, path in the TOML document, text of the default."""
    for name, model_field in type(model).model_fields.items():
        value = getattr(model, name)
        if isinstance(value, BaseModel):
            yield from _leaves(value, (*key, name), (*path, name))
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            for index, entry in enumerate(value):
                own = getattr(entry, "name", str(index))
                yield from _leaves(entry, (*key, name, own), (*path, name, index))
        elif isinstance(value, dict):
            for own, entry in value.items():
                yield from _leaves(entry, (*key, name, own), (*path, name, own))
        else:
            extras = model_field.metadata
            absent = next((extra.text for extra in extras if isinstance(extra, AbsentMeans)), None)
            if model_field.is_required():
                text = ""
            elif absent is not None and (model_field.default is None or not absent):
                text = absent
            else:
                text = _value_text(model_field.default)
            yield ".".join((*key, name)), (*path, name), text


def _resolved_text(scene: Scene, key: str, text: str) -> str:
    """Add the value to a default that is another entry of the scene."""
    if text == "contact.friction":
        return f"{scene.contact.friction:g} ({text})"
    if text == "process.time" and key.startswith("stages."):
        return "the end of the stage"
    if scene.stages and text.endswith(" of process.time"):
        return text.replace("process.time", "the stage in which it comes to work")
    if text == "process.time":
        return f"{scene.process.time:g} s ({text})"
    return _found_text(scene, key) or text


def _found_text(scene: Scene, key: str) -> str:
    """Return the value of an entry that is found with the time of the process; empty for others."""
    if not scene.time_is_found:
        return ""
    process = scene.process
    found = {
        "process.time": f"{process.time:.4g} s",
        **{f"stages.{s.name}.time": f"{s.time:.4g} s" for s in scene.stages if s.time_is_found},
        "process.mass_damping": f"{process.mass_damping:.4g} 1/s",
        "process.damping_average": f"{process.damping_average:.4g} s",
    }
    for tool in scene.tools:
        if isinstance(tool.motion, GuidedMotion):
            found[f"tools.{tool.name}.motion.ramp"] = f"{tool.motion.ramp:.4g} s"
    return f"{found[key]} (found from the sheet)" if key in found else ""


_ABSENT = object()


def _value_text(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        if not value:
            return "none"
        return "[" + ", ".join(_inner_text(item) for item in value) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} = {_inner_text(v)}" for k, v in value.items()) + "}"
    return str(value)


def _inner_text(value: object) -> str:
    # Quoted inside a list, so that the text can be given to --set again.
    return f'"{value}"' if isinstance(value, str) else _value_text(value)
