"""Files of a draped ply beside its fields: tables of its courses and joints, flat patterns."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lcmchain.draping.courses import Joint, joints_of
from lcmchain.draping.drape import Draped
from lcmchain.mesh.outline import polygon_area
from lcmchain.pattern.tables import Table, write_line, write_table
from lcmchain.pipeline import COURSE_FILE, JOINT_TABLE, PLY_TABLE


def write_draped_files(folder: Path, draped: Draped) -> None:
    """Write the table of a ply and, of several courses, that of its joints and flat patterns."""
    write_table(folder / PLY_TABLE, ply_table(draped))
    if not draped.courses:
        return
    write_table(folder / JOINT_TABLE, joint_table(joints_of(draped.courses)))
    for net in draped.courses:
        assert net.outline is not None
        for end in ("csv", "dxf"):
            write_line(folder / f"{COURSE_FILE}{net.name}.{end}", net.outline)


def ply_table(draped: Draped) -> Table:
    """Return a row for each course of a ply, or one for a ply of one piece.

    Returns
    -------
    columns of equal length: number and name; flat area [m2]; length along fibre 1 and width across
    it [m]; seed in the flat blank and its place [m]; direction of fibre 1 there; shear angle at
    the seed, its mean, least and largest value [rad]; part of the area beyond the locking angle.
    """
    rows = []
    shear = draped.shear_angle
    for number, net in enumerate(draped.nets):
        of_net = shear[draped.course_of_face == number]
        areas = net.mesh.element_areas
        length, width = np.ptp(net.coordinates, axis=0)
        begin = net.start
        rows.append(
            {
                "course": number,
                "name": net.name,
                "area [m2]": areas.sum() if net.outline is None else polygon_area(net.outline),
                "length [m]": length,
                "width [m]": width,
                **{f"seed {axis} [m]": begin.seed[k] for k, axis in enumerate("xy")},
                **{f"place {axis} [m]": begin.place[k] for k, axis in enumerate("xyz")},
                **{f"fibre 1 {axis} [1]": begin.direction_1[k] for k, axis in enumerate("xyz")},
                "shear angle at the seed [rad]": np.arcsin(begin.direction_1 @ begin.direction_2),
                "mean shear angle [rad]": (of_net * areas).sum() / areas.sum(),
                "least shear angle [rad]": of_net.min(),
                "largest shear angle [rad]": of_net.max(),
                "locked part [1]": areas[np.abs(of_net) > draped.locking_angle].sum() / areas.sum(),
            }
        )
    return {heading: np.array([row[heading] for row in rows]) for heading in rows[0]}


def joint_table(joints: list[Joint]) -> Table:
    """Return a row for each node of the joints between courses.

    Returns
    -------
    columns of equal length: names of both courses; length along fibre 1 in the flat blank from the
    seed of the first [m]; position [m]; gap, negative for an overlap, and that of the flat blank
    [m]. Nodes that lie beside the other course have no row.
    """
    known = [np.isfinite(joint.gap) for joint in joints]
    both = list(zip(joints, known, strict=True))

    def column(values: list[np.ndarray]) -> np.ndarray:
        return np.concatenate([np.empty(0), *values]) if both else np.empty(0)

    counts = [int(rows.sum()) for rows in known]
    return {
        "below": np.repeat([joint.below for joint in joints], counts),
        "above": np.repeat([joint.above for joint in joints], counts),
        "length [m]": column([joint.along[rows] for joint, rows in both]),
        **{
            f"{axis} [m]": column([joint.places[rows, k] for joint, rows in both])
            for k, axis in enumerate("xyz")
        },
        "gap [m]": column([joint.gap[rows] for joint, rows in both]),
        "flat gap [m]": np.repeat([joint.nominal for joint in joints], counts),
    }
