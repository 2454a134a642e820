"""The page of the commands, from the command line itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Protocol, runtime_checkable

from lcmchain.manual.tables import code, markdown_table

HEAD = """# Commands

Every command with its arguments and options; `lcmchain COMMAND --help` prints the same. Exit code
0: the work is done; 2: wrong input, the message names the key or the file and says what to do; 1: a
run that failed or was stopped.
"""


class Parameter(Protocol):
    """What the page reads of an argument or option; ``opts`` are the spellings of an option."""

    param_type_name: str
    name: str
    metavar: str | None
    opts: Sequence[str]
    is_flag: bool
    required: bool
    default: object
    help: str | None


class Command(Protocol):
    """What the page reads of a command."""

    help: str
    params: Sequence[Parameter]


@runtime_checkable
class Group(Protocol):
    """What the page reads of a group of commands."""

    commands: Mapping[str, Command | Group]


def command_page(root: Group) -> str:
    """Return the page as Markdown; ``root`` is the group of all commands."""
    parts = [HEAD]
    for name, command in leaf_commands(root, "lcmchain"):
        parts.append(f"## {name}\n")
        parts.append(f"{command.help.strip()}\n")
        parts.append(f"```console\n{_usage(name, command)}\n```\n")
        rows = [_row(parameter) for parameter in command.params]
        if rows:
            parts.append(markdown_table(("", "default", "meaning"), rows))
    return "\n".join(parts)


def leaf_commands(group: Group, name: str) -> Iterator[tuple[str, Command]]:
    """Yield the full name and the command of everything that can be called."""
    for part, command in group.commands.items():
        if isinstance(command, Group):
            yield from leaf_commands(command, f"{name} {part}")
        else:
            yield f"{name} {part}", command


def _usage(name: str, command: Command) -> str:
    words = [name]
    for parameter in command.params:
        if parameter.param_type_name == "argument":
            words.append(_value_name(parameter))
        elif parameter.required:
            words.append(f"{parameter.opts[0]} {_value_name(parameter)}")
    if any(p.param_type_name == "option" and not p.required for p in command.params):
        words.append("[OPTIONS]")
    return " ".join(words)


def _row(parameter: Parameter) -> tuple[str, str, str]:
    if parameter.param_type_name == "argument":
        return code(_value_name(parameter)), _default(parameter), parameter.help or ""
    names = ", ".join(parameter.opts)
    value = "" if parameter.is_flag else f" {_value_name(parameter)}"
    return code(names + value), _default(parameter), parameter.help or ""


def _value_name(parameter: Parameter) -> str:
    return parameter.metavar or parameter.name.upper()


def _default(parameter: Parameter) -> str:
    if parameter.required:
        return "required"
    if getattr(parameter, "is_flag", False) or parameter.default in (None, ()):
        return ""
    return code(str(parameter.default))
