"""Flat formed sheets, plates to map them onto, and analyses of these."""

from __future__ import annotations

import shutil
from types import SimpleNamespace

import numpy as np
import pytest

from lcmchain.mapping import map_file
from lcmchain.mapping.structure import SolverOptions, analyse
from lcmchain.scene import structure_from_text

SIDE, THICKNESS, V, FIBRE_DENSITY = 0.2, 2e-3, 0.5, 1760.0
MATERIAL = 'fibre = { preset = "T300" }\nresin = { preset = "MY750" }\n'

needs_calculix = pytest.mark.skipif(
    shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed"
)


def unit(angle):
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def condition(kind, name, **entries):
    """One [[supports]] or [[loads]] table as TOML."""
    return f'[[{kind}]]\nname = "{name}"\n' + "".join(f"{k} = {v}\n" for k, v in entries.items())


def plane(normal, position):
    return f'{{ normal = {list(normal)}, position = "{position} m" }}'


def simply_supported(shell, side=SIDE):
    """Hard simple supports of a square plate: no deflection, no motion along the edge.

    Solids are held over the whole side; shells at their nodes, and against turning about the normal
    of the edge.
    """
    text = ""
    for axis, along in ((0, "y"), (1, "x")):
        for end in (0.0, side):
            normal = [float(k == axis) for k in range(3)]
            turn = f', "r{"xy"[axis]}"' if shell else ""
            fixed = f'["{along}", "z"{turn}]'
            text += condition("supports", f"edge{axis}{int(end > 0)}", fixed=fixed,
                              plane=plane(normal, end))  # fmt: skip
    return text


@pytest.fixture(scope="session")
def kit(make):
    """Makers of formed sheets and plates; see their docstrings."""

    def formed(angles=(0.0, np.pi / 2), *, side=SIDE, thickness=THICKNESS, v=V):
        """A flat forming result, larger than the plate, with its two families at these angles."""
        points, quads = make.grid(12, 12, (-0.1 * side, -0.1 * side), (1.1 * side, 1.1 * side))
        points = make.lifted(points)
        count = len(quads)
        result = make.forming_result(
            points,
            quads,
            thickness=thickness,
            fibre_volume_fraction=v,
            areal_fibre_mass=thickness * v * FIBRE_DENSITY,
            shear_angle=0.0,
            fibre_direction_1=np.tile(unit(angles[0]), (count, 1)),
            fibre_direction_2=np.tile(unit(angles[1]), (count, 1)),
        )
        result.attrs["fibre_density_kg_m3"] = FIBRE_DENSITY
        return result

    def plate(cells, count=8, *, side=SIDE, thickness=THICKNESS, layers=1, jitter=0.0):
        """Points and blocks of a square plate of shells or solids around z = 0."""
        points, quads = make.grid(count, count, high=(side, side), jitter=jitter)
        flat = make.triangles_of(quads) if cells in ("triangle", "wedge") else quads
        if cells in ("triangle", "quad"):
            return make.lifted(points), [(cells, flat)]
        heights = np.linspace(-0.5 * thickness, 0.5 * thickness, layers + 1)
        space = np.concatenate([make.lifted(points) + [0.0, 0.0, h] for h in heights])
        below = [flat + k * len(points) for k in range(layers)]
        return space, [(cells, np.concatenate([np.hstack([b, b + len(points)]) for b in below]))]

    return SimpleNamespace(formed=formed, plate=plate)


@pytest.fixture
def solve(kit, write_mesh, tmp_path):
    """Map a flat sheet onto a plate and analyse it; returns the report and the results."""

    def run(cells, case, *, angles=(0.0, np.pi / 2), options=None, **plate):
        mesh = write_mesh(*kit.plate(cells, **plate), "mesh.vtu")
        thickness = plate.get("thickness", THICKNESS)
        source = kit.formed(angles, side=plate.get("side", SIDE), thickness=thickness)
        map_file(source, mesh, tmp_path / "plate.nc", picture=False)
        structure = structure_from_text(MATERIAL + case)
        options = options or SolverOptions(picture=False)
        return analyse(
            tmp_path / "plate.nc", mesh, structure, name="plate", out_dir=tmp_path, options=options
        )

    return run
