"""Wrong meshes to map onto, and wrong forming results to map from."""

from __future__ import annotations

import math
import random
import shutil
from pathlib import Path

import meshio
import netCDF4
import numpy as np
import xarray as xr
from contract import Case
from mutations import mutated_bytes

from lcmchain.fields.netcdf_file import write_netcdf

WIDTH = 0.1  # of the sheet [m]
CELLS = 8  # of the sheet along a side


def prepare(folder: Path) -> None:
    """Write a sound forming result, a shallow bowl."""
    write_netcdf(folder / "sound.nc", {"/": forming_result()})


def sound_calls(folder: Path) -> list[list[str]]:
    """Write meshes that are right and return the calls that map onto them."""
    points, quads = grid(6, 0.08)
    lifted = np.concatenate([points, points + [0.0, 0.0, 1e-3]])
    solids = np.hstack([quads, quads + len(points)])
    files = [
        _written(folder / "shells.vtu", points, quads),
        _written(folder / "solids.vtu", lifted, solids, "hexahedron"),
    ]
    out = str(folder / "out" / "mapped.nc")
    return [
        ["map", str(folder / "sound.nc"), str(file), "--out", out, "--method", method]
        for file in files
        for method in ("overlap", "closest")
    ]


def grid(count: int, width: float = WIDTH) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and quadrilaterals of a shallow bowl."""
    x = np.linspace(-0.5 * width, 0.5 * width, count + 1)
    points = np.array([(a, b, 2.0 * (a * a + b * b)) for a in x for b in x])
    node = np.arange(len(points)).reshape(count + 1, count + 1)
    corners = (node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:])
    return points, np.stack([corner.ravel() for corner in corners], axis=1)


def forming_result() -> xr.Dataset:
    """The root group of a forming result, with the fields that a mapping takes."""
    points, faces = grid(CELLS)
    dataset = xr.Dataset(attrs={"Conventions": "CF-1.11 UGRID-1.0", "state": "complete"})
    dataset["sheet"] = ((), np.int32(0), {
        "cf_role": "mesh_topology", "topology_dimension": np.int32(2),
        "node_coordinates": "sheet_node_x sheet_node_y sheet_node_z",
        "face_node_connectivity": "sheet_face_nodes", "face_dimension": "sheet_face",
    })  # fmt: skip
    dataset["sheet_face_nodes"] = (
        ("sheet_face", "sheet_face_corner"), faces.astype(np.int32),
        {"cf_role": "face_node_connectivity", "start_index": np.int32(0),
         "_FillValue": np.int32(-1)},
    )  # fmt: skip
    for axis, values in zip("xyz", points.T):
        dataset[f"sheet_node_{axis}"] = ("sheet_node", values, {"units": "m"})
    fields = {
        "thickness": (1e-3, "m"), "fibre_volume_fraction": (0.5, "1"), "shear_angle": (0.2, "rad"),
        "areal_fibre_mass": (0.6, "kg m-2"), "fibre_direction_1_x": (1.0, "1"),
        "fibre_direction_1_y": (0.0, "1"), "fibre_direction_1_z": (0.0, "1"),
        "fibre_direction_2_x": (0.0, "1"), "fibre_direction_2_y": (1.0, "1"),
        "fibre_direction_2_z": (0.0, "1"),
    }  # fmt: skip
    for name, (value, units) in fields.items():
        attributes = {"units": units, "mesh": "sheet", "location": "face"}
        values = np.full((2, len(faces)), value)
        if "direction" not in name:
            values *= np.linspace(0.9, 1.1, len(faces))
        dataset[name] = (("time", "sheet_face"), values, attributes)
    return dataset


def make(rng: random.Random, folder: Path) -> Case:
    """Write a wrong mesh or a wrong source, and return the call that maps."""
    source, options = folder / "sound.nc", []
    if rng.random() < 0.5:
        target, what, must_refuse = _wrong_target(rng, folder)
    else:
        target = _written(folder / "target.vtu", *grid(6, 0.08))
        source, what, must_refuse = _wrong_source(rng, folder)
    if rng.random() < 0.3:
        options.append("--allow-unmapped")
    if rng.random() < 0.3:
        options += ["--kind", rng.choice(["infiltration", "structure"])]
    if rng.random() < 0.2:
        options += [
            "--length-unit",
            rng.choice(["mm", "inch", "um", "km", "1e9 m", "kg", "", "m*" * 99]),
        ]
    if rng.random() < 0.2:
        distance = rng.choice(["1 mm", "0 mm", "1e302 m", "nan mm", "5", "1e5 m", "1e-9 m"])
        options += ["--maximum-distance", distance]
    if rng.random() < 0.2:
        options += ["--method", rng.choice(["closest", "overlap", "nearest"])]
    out = folder / "out" / "mapped.nc"
    if rng.random() < 0.05:
        what, out = f"{what}, out a folder", folder
    return Case(
        ["map", str(source), str(target), "--out", str(out), *options], f"{what} {options}",
        [source, target, out], folder / "out", must_refuse, check=lambda: _complaint(out),
    )  # fmt: skip


def _written(path: Path, points: np.ndarray, cells, name: str = "quad") -> Path:
    blocks = cells if isinstance(cells, list) else [(name, cells)]
    meshio.Mesh(points, blocks).write(path)
    return path


def _wrong_target(rng: random.Random, folder: Path) -> tuple[Path, str, bool]:
    points, quads = grid(6, 0.08)
    name, cells = "quad", quads.copy()
    if rng.random() < 0.5:
        name, cells = "triangle", np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    elif rng.random() < 0.4:
        lifted = points + [0.0, 0.0, 1e-3]
        name, cells = "hexahedron", np.hstack([quads, quads + len(points)])
        points = np.concatenate([points, lifted])
    kind = rng.choice(["index", "negative", "repeated", "nan", "inf", "huge", "flat", "point",
                       "lines",
                       "mixed", "shuffled", "far", "scaled", "bytes", "bytes", "format",
                       "empty", "plane",
                       "random", "folder", "absent", "sound"])  # fmt: skip
    row, corner = rng.randrange(len(cells)), rng.randrange(cells.shape[1])
    path = (
        folder / f"target.{rng.choice(['vtu', 'vtk', 'msh', 'inp', 'stl', 'obj', 'xdmf', 'nas'])}"
    )
    if path.suffix in (".stl", ".obj") and name != "triangle":
        path = path.with_suffix(".vtu")
    must_refuse = kind in ("index", "negative", "nan", "inf", "point", "lines", "folder", "absent")
    if kind in ("index", "negative"):
        path = folder / "target.vtu"  # other formats write numbers from one, or places
        cells[row, corner] = len(points) + rng.choice([0, 1, 10**6]) if kind == "index" else -1
    elif kind == "repeated":
        cells[row] = cells[row, corner]
        must_refuse = path.suffix == ".vtu"
    elif kind in ("nan", "inf"):
        path = folder / "target.vtu"
        points[cells[row, corner], rng.randrange(3)] = math.nan if kind == "nan" else math.inf
    elif kind == "huge":
        points[cells[row, corner]] *= 10.0 ** rng.uniform(3, 300)
    elif kind == "flat":
        points[:, rng.randrange(3)] = 0.0
    elif kind == "point":
        path = folder / "target.vtu"
        points[...] = points[0]
    elif kind == "lines":
        path, name, cells = folder / "target.vtu", "line", quads[:, :2]
    elif kind == "mixed":
        path = folder / "target.vtu"
        cells = [("line", quads[:, :2]), ("quad", quads), ("triangle", quads[:, :3])]
    elif kind == "shuffled":
        cells = cells[:, rng.sample(range(cells.shape[1]), cells.shape[1])]
    elif kind == "far":
        points += rng.choice([0.01, 0.2, 3.0, 1e6])
    elif kind == "scaled":
        points *= rng.choice([1e3, 25.4, 1e-3, 1 / 25.4, 1e-9, 1e12, -1.0])
    elif kind == "random":
        points = np.array([[rng.uniform(-0.1, 0.1) for _ in "xyz"] for _ in points])
    elif kind == "plane":
        path, points = folder / "target.vtk", points[:, :2]
    if kind == "folder":
        path = folder / "a_folder.vtu"
        path.mkdir(exist_ok=True)
        return path, "target: folder", True
    if kind == "absent":
        return folder / "absent.vtu", "target: absent", True
    try:
        _written(path, points, cells, name)
    except BaseException:  # meshio cannot write it so; then as VTU
        path = _written(folder / "target.vtu", points, cells, name)
    if kind == "bytes":
        path.write_bytes(mutated_bytes(rng, path.read_bytes())[0])
    elif kind == "format":
        path = path.rename(path.with_suffix(rng.choice([".msh", ".vtk", ".xyz", ".h5m", ""])))
    elif kind == "empty":
        path.write_bytes(b"")
    return path, f"target: {kind} {name} {path.suffix}", must_refuse


def _wrong_source(rng: random.Random, folder: Path) -> tuple[Path, str, bool]:
    path = folder / "source.nc"
    shutil.copy(folder / "sound.nc", path)
    kind = rng.choice(["bytes", "bytes", "truncated", "drop", "rename", "units", "nan",
                       "index", "negative",
                       "dims", "attribute", "no mesh", "text", "folder", "other netcdf",
                       "positions",
                       "repeated", "sound"])  # fmt: skip
    must_refuse = kind in ("truncated", "no mesh", "text", "folder", "other netcdf", "index",
                           "units",
                           "repeated")  # fmt: skip
    if kind == "bytes":
        path.write_bytes(mutated_bytes(rng, path.read_bytes())[0])
        return path, "source: bytes", False
    if kind == "truncated":
        content = path.read_bytes()
        path.write_bytes(content[: rng.randrange(int(0.99 * len(content)))])
        return path, "source: truncated", True
    if kind == "text":
        path.write_text("this is no netCDF file\n" * 100)
        return path, "source: text", True
    if kind == "folder":
        return folder, "source: folder", True
    dataset = forming_result()
    field = rng.choice(["thickness", "fibre_volume_fraction", "areal_fibre_mass", "shear_angle"])
    key = rng.choice(list(dataset.variables))
    if kind == "drop":
        dataset = dataset.drop_vars(key)
        what = key
    elif kind == "rename":
        dataset = dataset.rename({key: "renamed"})
        what = key
    elif kind == "units":
        what = rng.choice(["sheet_node_x", field])
        dataset[what].attrs["units"] = rng.choice(["mm", "inch", "degree", "g m-2", "percent"])
    elif kind in ("nan", "positions", "negative"):
        what = f"sheet_node_{rng.choice('xyz')}" if kind == "positions" else field
        value = rng.choice([math.nan, math.inf, 1e300]) if kind != "negative" else -1e-3
        dataset[what].values[..., 3] = value
        must_refuse = kind != "nan" or not math.isfinite(value)
        must_refuse &= not (kind == "negative" and field == "shear_angle")
    elif kind in ("index", "repeated"):
        nodes = dataset["sheet_face_nodes"].values
        nodes[5, 1:] = nodes[5, 0] if kind == "repeated" else rng.choice([-5, 999, 2**30])
        what = kind
    elif kind == "dims":
        what = field
        dataset[field] = (("time", "other"), np.ones((2, 5)), dataset[field].attrs)
    elif kind == "attribute":
        variable = rng.choice(["sheet", "sheet_face_nodes"])
        name = rng.choice(list(dataset[variable].attrs))
        what = f"{variable}:{name}"
        if rng.random() < 0.5:
            del dataset[variable].attrs[name]
        else:
            dataset[variable].attrs[name] = rng.choice(
                ["", "nothing", np.int32(7), 2.5, "a b", [1, 2]]
            )
    elif kind == "no mesh":
        dataset, what = dataset.drop_vars(["sheet", "sheet_face_nodes"]), ""
    elif kind == "other netcdf":
        dataset, what = xr.Dataset({"a": ("x", [1.0, 2.0])}), ""
    else:
        what = ""
    path.unlink()
    try:
        write_netcdf(path, {"/": dataset})
    except Exception:  # an attribute that netCDF cannot hold
        with netCDF4.Dataset(path, "w") as file:
            file.title = "empty"
        must_refuse = True
    return path, f"source: {kind} {what}", must_refuse


def _complaint(out: Path) -> str | None:
    """Say what is wrong with a mapped file."""
    with xr.open_dataset(out, mask_and_scale=False) as dataset:
        status = dataset["mapping_status"].values
        mapped = status != 3
        if not mapped.any():
            return "not one cell is mapped"
        limit = dataset.attrs["mapping_maximum_distance_m"]
        distance = dataset["mapping_distance"].values
        if np.nanmax(distance[mapped]) > limit * (1.0 + 1e-9):
            return "a mapped cell lies farther away than the largest distance"
        nodes = [name for name in dataset.variables if "node_" in str(name)]
        for name in nodes:
            if dataset[name].dtype.kind == "f" and not np.isfinite(dataset[name].values).all():
                return f"{name} is not finite"
        fields = [n for n in dataset.data_vars if dataset[n].dims == dataset["mapping_status"].dims]
        if "mapping_coverage" not in fields or len(fields) < 4:
            return "no field was mapped"
        for name in fields:
            values = dataset[name].values
            if values.dtype.kind != "f" or name == "mapping_distance":
                continue
            # A fibre at right angles to a cell has no direction in it, and the report says so.
            tilted = "direction" in name and "leaves the plane" in dataset.attrs["mapping_warnings"]
            if not np.isfinite(values[mapped]).all() and not tilted:
                return f"{name} of a mapped cell is not finite"
            if name != "mapping_coverage" and np.isfinite(values[~mapped]).any():
                return f"{name} has values in unmapped cells"
        if "thickness" in fields:
            values = dataset["thickness"].values[mapped]
            if values.min() < 0.0 or values.max() > 1.0:
                return "a thickness beyond any of the source"
    return None
