"""Read a scene file: TOML text, overrides, validation, and the record of what was used."""

from __future__ import annotations

import copy
import hashlib
import re
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import FROM_FILE, AbsentMeans
from lcmchain.scene.explain import Problem, key_text, problems_of
from lcmchain.scene.overrides import apply_overrides
from lcmchain.scene.presets import PRESETS
from lcmchain.scene.scene import Scene, SceneSource
from lcmchain.text_files import decode_text


def read_scene(path: str | Path, overrides: Sequence[str] = ()) -> Scene:
    """Read and validate a scene file.

    Parameters
    ----------
    path : TOML file; file names in it are relative to its folder.
    overrides : ``key=value`` texts that replace or add entries, see
        :func:`lcmchain.scene.overrides.apply_overrides`.

    Raises
    ------
    InputError : the file cannot be read, is not TOML, or any entry is wrong; all wrong entries are
        named in one message.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError("is a folder; name the scene file in it, such as scene.toml", file=path)
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise InputError("there is no such scene file", file=path) from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None
    text = decode_text(content, path)
    return scene_from_text(text, path, overrides)


def scene_from_text(
    text: str, path: str | Path | None = None, overrides: Sequence[str] = ()
) -> Scene:
    """Validate the text of a scene file.

    Parameters
    ----------
    text : TOML.
    path : the file that it came from; its folder is where file names in the scene are looked up
        (the current folder where None).
    overrides : as in :func:`read_scene`.

    Raises
    ------
    InputError : as in :func:`read_scene`.
    """
    path = None if path is None else Path(path)
    directory = Path.cwd() if path is None else path.resolve().parent
    data = _parse_toml(text, path)
    apply_overrides(data, overrides)
    try:
        scene = Scene.model_validate(copy.deepcopy(data), context=FROM_FILE)
    except ValidationError as error:
        # Files are looked up even so, to report everything that is wrong at once.
        missing = _missing_files(data, directory)
        raise _input_error(problems_of(error, data) + missing, path) from None
    missing = _missing_files(data, directory)
    if missing:
        raise _input_error(missing, path)
    full_text = text
    if overrides:
        full_text = text.rstrip("\n") + "\n\n# Overrides:\n"
        full_text += "".join(f"# --set {' '.join(item.splitlines())}\n" for item in overrides)
    given, defaulted = _used_values(scene, data)
    scene._source = SceneSource(
        path=path,
        directory=directory,
        text=full_text,
        sha256=hashlib.sha256(full_text.encode()).hexdigest(),
        given=given,
        defaulted=defaulted,
    )
    return scene


def _parse_toml(text: str, path: Path | None) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        message = f"is not valid TOML: {error}"
        match = re.search(r"at line (\d+)", str(error))
        if match is not None:
            line = text.splitlines()[int(match[1]) - 1].strip()
            message += f"\n  {match[1]} | {line}"
            if re.fullmatch(r"[\w.\-\"]+\s*=\s*[+-]?[\d.]+(e[+-]?\d+)?\s*[A-Za-zµ°].*", line):
                message += '\n  values with units stand in quotes, for example "5 mm"'
        raise InputError(message, file=path or "scene text") from None


def _input_error(problems: list[Problem], path: Path | None) -> InputError:
    file = None if path is None else str(path)
    if len(problems) == 1:
        place = f" [{file}]" if file else ""
        key = problems[0].key or None
        return InputError(problems[0].message + place, key=key, file=file)
    lines = "".join(f"\n  {problem}" for problem in problems)
    return InputError(f"has {len(problems)} errors:{lines}", file=file or "scene text")


def _missing_files(data: dict[str, Any], directory: Path) -> list[Problem]:
    """Name the files that a scene points to and that are not there."""
    problems = []
    for table, path in (("tools", ("shape", "file")), ("mapping", ("mesh",))):
        entries = data.get(table)
        for index, entry in enumerate(entries if isinstance(entries, list) else ()):
            value: Any = entry
            for step in path:
                value = value.get(step) if isinstance(value, dict) else None
            if not isinstance(value, str) or not value.strip():
                continue
            file = directory / value
            key = key_text((table, index, *path), data)
            if not file.exists():
                problems.append(
                    Problem(
                        key,
                        f'there is no file "{value}" in {directory}; file names are relative to '
                        "the scene file",
                    )
                )
            elif not file.is_file() or file.stat().st_size == 0:
                what = "is empty" if file.is_file() else "is not a file"
                problems.append(Problem(key, f'"{value}" {what}'))
    return problems


# --- what was given and what was defaulted --------------------------------------------------------


def _used_values(
    scene: Scene, data: dict[str, Any]
) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    given: list[tuple[str, str]] = []
    defaulted: list[tuple[str, str]] = []
    if isinstance(data.get("element"), str):
        data = data | {"element": {"type": data["element"]}}
    preset_name = getattr(scene.material, "preset", None)
    preset = {"material": PRESETS[preset_name]} if preset_name else {}
    for key, raw_path, text in _leaves(scene, (), ()):
        value = _lookup(data, raw_path)
        from_preset = _lookup(preset, raw_path)
        if value is not _ABSENT:
            given.append((key, _value_text(value)))
        elif from_preset is not _ABSENT:
            defaulted.append((key, f"{_value_text(from_preset)} (preset {preset_name})"))
        elif text:
            defaulted.append((key, _resolved_text(scene, key, text)))
    return given, defaulted


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
                yield from _leaves(entry, (*key, name, entry.name), (*path, name, index))
        else:
            extras = model_field.metadata
            absent = next((extra.text for extra in extras if isinstance(extra, AbsentMeans)), None)
            if model_field.is_required():
                text = ""
            elif model_field.default is None and absent is not None:
                text = absent
            else:
                text = _value_text(model_field.default)
            yield ".".join((*key, name)), (*path, name), text


def _resolved_text(scene: Scene, key: str, text: str) -> str:
    """Add the value to a default that is another entry of the scene."""
    if text == "contact.friction":
        return f"{scene.contact.friction:g} ({text})"
    if text == "process.time":
        return f"{scene.process.time:g} s ({text})"
    return text


_ABSENT = object()


def _lookup(data: Any, path: Sequence[str | int]) -> Any:
    for step in path:
        try:
            data = data[step]
        except (KeyError, IndexError, TypeError):
            return _ABSENT
    return data


def _value_text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        if not value:
            return "none"
        return "[" + ", ".join(_inner_text(item) for item in value) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} = {_inner_text(v)}" for k, v in value.items()) + "}"
    return str(value)


def _inner_text(value: Any) -> str:
    # Quoted inside a list, so that the text can be given to --set again.
    return f'"{value}"' if isinstance(value, str) else _value_text(value)
