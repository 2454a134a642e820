"""What all cases have in common: templates, and process, blank, material and friction."""

from __future__ import annotations

import json
import math
import textwrap
from dataclasses import dataclass
from importlib.resources import files
from string import Template

from lcmchain.errors import InputError
from lcmchain.scene.presets import PUBLISHED, PublishedFabric

# --- templates with ``$name`` where a value stands ------------------------------------------------


def filled(name: str, values: dict[str, str]) -> str:
    """Return a template with its values.

    Parameters
    ----------
    name : of the file in ``templates``, without ``.toml``.
    values : of all that the template asks for; more may be given.
    """
    text = (files(__package__) / "templates" / f"{name}.toml").read_text(encoding="utf-8")
    return Template(text).substitute(values)


def quoted(text: str) -> str:
    """Return a text as TOML writes it; its escapes are those of JSON."""
    return json.dumps(text, ensure_ascii=False)


def mm(length: float) -> str:
    """Return a length [m] as a scene gives it, to a micrometre."""
    return f"{round(1e3 * length, 3):g} mm"


def wrapped_comment(text: str) -> str:
    """Return a text as comment lines of a scene."""
    lines = textwrap.wrap(text, width=96, break_long_words=False, break_on_hyphens=False)
    return "\n".join(f"# {line}" for line in lines)


# --- the scene up to its tools --------------------------------------------------------------------


#: Elements along the shorter side of a blank whose edge length nobody gives.
ELEMENTS_ALONG_BLANK = 40


@dataclass(frozen=True)
class Sheet:
    """The sheet of a new scene, in SI units; None takes what the case finds suitable.

    Parameters
    ----------
    preset : published fabric; size : sides of the blank along x and y [m].
    edge_length : of the elements [m]; fibre_angle : from x to fibre direction 1, as a text.
    friction : Coulomb coefficient; time : of the process [s].
    """

    preset: str = "MD600"
    size: tuple[float, float] | None = None
    edge_length: float | None = None
    fibre_angle: str = "0 deg"
    friction: float | None = None
    time: float | None = None

    @property
    def fabric(self) -> PublishedFabric:
        """The published fabric.

        Raises
        ------
        InputError : there is none of this name.
        """
        if self.preset not in PUBLISHED:
            raise InputError(
                f'there is no preset "{self.preset}"; there is {", ".join(PUBLISHED)}',
                key="--preset",
            )
        return PUBLISHED[self.preset]

    @property
    def thickness(self) -> float:
        """Thickness of the unloaded fabric [m]."""
        return self.fabric.material.thickness


@dataclass(frozen=True)
class Process:
    """How a case moves its sheet: damping, weight, and the reasons.

    ``time`` [s] is that of a case with a time of its own; without one the program finds the pace.
    """

    damping: str
    damping_reason: str
    gravity: bool
    gravity_reason: str
    time: float | None = None


def round_edge_length(length: float) -> float:
    """Return the nearest of 1, 2, 2.5, 5 times a power of ten that is not longer [m]."""
    unit = 10.0 ** math.floor(math.log10(length))
    return max(step * unit for step in (1.0, 2.0, 2.5, 5.0) if step * unit <= length * (1 + 1e-9))


def two_digits(value: float) -> float:
    """Return a positive number rounded to two digits."""
    return float(f"{value:.1e}")


def _time_lines(sheet: Sheet, process: Process) -> str:
    """Return the lines of a scene that say how slow its process is."""
    time = sheet.time or process.time
    if time is None:
        return filled("found_time", {}).rstrip("\n")
    values = {
        "time": f"{1e3 * time:.6g} ms",
        "time_origin": "As given" if sheet.time else "Assumed",
        "mass_damping": process.damping,
        "damping_reason": process.damping_reason,
    }
    return filled("time", values).rstrip("\n")


def sheet_text(
    sheet: Sheet,
    process: Process,
    *,
    case: str,
    file: str,
    headline: str,
    remarks: str,
    size: tuple[float, float],
    edge_length: float,
    height: float,
    height_reason: str,
    material: str | None = None,
) -> str:
    """Return the part of a scene up to its tools.

    Parameters
    ----------
    case, file : names of case and scene file; headline, remarks : what the scene is.
    size, edge_length, height : of the blank [m]; material : table in place of the preset's name.
    """
    friction = 0.157 if sheet.friction is None else sheet.friction
    if sheet.friction is not None:
        reason = "As given."
    elif sheet.preset == "MD600":
        reason = "That of MD600 (sled test, Schäfer, Mitsch, Kärger, section 4.1)."
    else:
        reason = "Assumed: that of MD600."
    values = {
        "headline": headline,
        "case": case,
        "file": file,
        "remarks": wrapped_comment(remarks),
        "title": quoted(headline),
        "time": _time_lines(sheet, process),
        "gravity": str(process.gravity).lower(),
        "gravity_reason": process.gravity_reason,
        "size": ", ".join(quoted(mm(side)) for side in size),
        "edge_length": mm(edge_length),
        "fibre_angle": sheet.fibre_angle,
        "height": mm(height),
        "height_reason": height_reason,
        "friction": f"{friction:g}",
        "friction_reason": reason,
    }
    values["material"] = material or filled(
        "preset", {"preset": sheet.preset, "description": sheet.fabric.description}
    )
    return filled("sheet", values)
