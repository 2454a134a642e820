"""The include file for OpenRadioss is read back by its columns, and forms the plies anew.

The reader here follows the description of the columns in OpenRadioss's own ``hm_cfg_files`` and
does with them what its starter does (``corthini.F``, ``corthdir.F``, ``layini1.F``).
"""

import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping import MappingOptions, map_file, read_target
from lcmchain.mapping.formats import export
from lcmchain.mesh_files.shapes import corner_count

#: Widths of the columns of every card, by keyword; a card that repeats is the last.
CARDS = {
    "NODE": [(10, 20, 20, 20)],
    "PART": [(100,), (10, 10, 10)],
    "PROP": [(100,)],
    "SHELL": [(10,) * 5],
    "SH3N": [(10,) * 4],
    "GRSHEL": [(100,), (10,) * 10],
    "GRSH3N": [(100,), (10,) * 10],
    "PLY": [(100,), (10, 20, 20, 10, 10, 10, 20), (10,)],
    "DRAPE": [(100,), (10, 10, 20, 20)],
    "STACK": [(100,), (10,) * 4, (20,) * 4, (10, 10, 20, 10, 10, 10, 10),
              (20, 20, 20, 10, 10, 10, 10), (10, 20, 20)],
}  # fmt: skip


def blocks(path):
    """Yield keyword, the rest of the keyword line and the cards, each a list of texts by column."""
    found = []
    for line in path.read_text(encoding="ascii").splitlines():
        if line.startswith("#"):
            continue
        if line.startswith("/"):
            keyword, *rest = line[1:].split("/")
            found.append((keyword, rest, []))
            continue
        keyword, _, cards = found[-1]
        widths = CARDS[keyword][min(len(cards), len(CARDS[keyword]) - 1)]
        ends = np.cumsum(widths)
        assert len(line) <= max(ends[-1], 100)
        cards.append([line[end - width : end].strip() for end, width in zip(ends, widths)])
    return found


class Deck:
    """What the starter would hold: nodes, elements, plies with angle and thickness by element."""

    def __init__(self, path):
        all_blocks = blocks(path)
        self.of = {}
        for keyword, rest, cards in all_blocks:
            self.of.setdefault(keyword, []).append((rest, cards))
        ((_, nodes),) = self.of["NODE"]
        self.nodes = {int(card[0]): np.array(card[1:], dtype=float) for card in nodes}
        self.elements = {
            (keyword, int(card[0])): [int(node) for node in card[1:]]
            for keyword in ("SHELL", "SH3N")
            for _, cards in self.of.get(keyword, [])
            for card in cards
        }
        self.groups = {
            (keyword, int(rest[1])): [int(text) for card in cards[1:] for text in card if text]
            for keyword in ("GRSHEL", "GRSH3N")
            for rest, cards in self.of.get(keyword, [])
        }
        self.drapes = {
            int(rest[0]): {
                (card[0], int(card[1])): (float(card[2]), float(card[3])) for card in cards[1:]
            }
            for rest, cards in self.of["DRAPE"]
        }
        ((_, stack),) = self.of["STACK"]
        assert int(stack[4][6]) == 20  # angles from node 1 to node 2
        self.order = [int(card[0]) for card in stack[5::2]]
        assert [card[0] for card in stack[6::2]] == [""] * len(self.order)
        self.stack_angle = {int(card[0]): float(card[1]) for card in stack[5::2]}
        self.plies = {int(rest[0]): cards for rest, cards in self.of["PLY"]}

    def title(self, ply):
        return self.plies[ply][0][0]

    def layers(self, ply):
        """Direction and thickness of a ply by element, as the starter makes them."""
        _, (material, t, angle, quads, triangles, points, _), (drape,) = self.plies[ply]
        assert int(material) >= 1 and int(points) == 1
        drape = self.drapes[int(drape)]
        members = [("SHELL", i) for i in self.groups.get(("GRSHEL", int(quads)), [])]
        members += [("SH3N", i) for i in self.groups.get(("GRSH3N", int(triangles)), [])]
        assert set(members) == set(drape)
        found = {}
        for entity, number in members:
            corner = np.array([self.nodes[node] for node in self.elements[entity, number]])
            across = (
                corner[[2, -1]] - corner[[0, 1]]
                if len(corner) == 4
                else (corner[[1, 2]] - corner[0])
            )
            normal = np.cross(*across)
            normal /= np.linalg.norm(normal)
            side = corner[1] - corner[0]
            side -= normal * (side @ normal)
            side /= np.linalg.norm(side)
            thinning, theta = drape[entity, number]
            phi = np.radians(float(angle) + self.stack_angle[ply] + theta)
            direction = np.cos(phi) * side + np.sin(phi) * np.cross(normal, side)
            found[number] = direction, float(t) * thinning
        return found


@pytest.fixture(scope="module")
def written(bowl, tmp_path_factory):
    path = tmp_path_factory.mktemp("radioss") / "bowl.openradioss.inc"
    report = export(bowl.dataset, bowl.target, "openradioss", path)
    return Deck(path), report, path


def test_the_mesh_is_that_of_the_target(bowl, written):
    deck, report, _ = written
    target = bowl.target
    row = {number: row for row, number in enumerate(target.node_ids.tolist())}
    assert len(deck.elements) == target.cell_count == report.cells
    for (entity, number), nodes in deck.elements.items():
        corners = target.corners[np.flatnonzero(target.cell_ids == number)[0]]
        assert [row[node] for node in nodes] == corners[corners >= 0].tolist()
        assert entity == ("SHELL" if len(nodes) == 4 else "SH3N")
    for number, place in deck.nodes.items():
        np.testing.assert_allclose(place, target.points[row[number]], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("family", [1, 2])
def test_the_starter_turns_the_side_into_the_fibre(bowl, written, vectors, family):
    deck, _, _ = written
    assert deck.title(family) == f"fibre_direction_{family}"
    layers = deck.layers(family)
    fibre = vectors(bowl.dataset, f"fibre_direction_{family}")
    found = np.array([layers[number][0] for number in bowl.target.cell_ids.tolist()])
    aligned = np.abs(np.einsum("ci,ci->c", found, fibre))
    assert np.degrees(np.arccos(np.clip(aligned, 0.0, 1.0))).max() < 1e-5


def test_plies_of_both_families_are_together_as_thick_as_the_sheet(bowl, written):
    deck, _, _ = written
    thickness = sum(
        np.array([deck.layers(ply)[number][1] for number in bowl.target.cell_ids.tolist()])
        for ply in deck.order
    )
    np.testing.assert_allclose(thickness, bowl.dataset["thickness"].values, rtol=1e-11)


def test_the_file_says_what_the_deck_has_to_give(written):
    _, report, path = written
    assert "define the material 1 in the deck" in report.warnings[-1]
    assert "Units: kg, m, s" in path.read_text().split("/NODE")[0]


def test_unmapped_cells_are_in_the_mesh_and_in_no_ply(bowl, tmp_path):
    dataset = bowl.dataset.copy(deep=True)
    dataset["thickness"].values[[0, 3]] = np.nan
    report = export(dataset, bowl.target, "openradioss", tmp_path / "hole.inc")
    deck = Deck(tmp_path / "hole.inc")
    assert len(deck.elements) == bowl.target.cell_count
    assert len(deck.layers(1)) == bowl.target.cell_count - 2
    assert any("2 unmapped cells" in sentence for sentence in report.warnings)


def test_numbers_that_the_starter_does_not_hold_are_errors(bowl, numbered, tmp_path):
    for ids, message in (
        (bowl.target.cell_ids + 2**31, "none that OpenRadioss holds"),
        (np.ones(bowl.target.cell_count, dtype=int), "the same number"),
    ):
        with pytest.raises(InputError, match=message):
            export(*numbered(bowl, ids), "openradioss", tmp_path / "no.inc")
    dataset = bowl.dataset.copy(deep=True)
    dataset["thickness"].values[:] = np.nan
    with pytest.raises(InputError, match="no cell has a thickness"):
        export(dataset, bowl.target, "openradioss", tmp_path / "no.inc")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_plies_of_a_stack_lie_lowest_first_with_their_own_thinning(
    make, flat_stack, write_mesh, tmp_path, order
):
    """Two flat plies of unlike shear on a mesh of both cells; the upper one is short and thins."""
    forming, thickness_at, names = flat_stack(order)
    flat, quads = make.grid(18, 18, (-0.9, -0.9), (0.9, 0.9))
    halves = np.concatenate([quads[:4, [0, 1, 2]], quads[:4, [0, 2, 3]]])
    mesh = write_mesh(make.lifted(flat), [("quad", quads[4:]), ("triangle", halves)])
    options = MappingOptions(exports=("openradioss",))
    report = map_file(forming, mesh, tmp_path / "stack.nc", options)
    deck, target = Deck(tmp_path / "stack.openradioss.inc"), read_target(mesh)
    assert [deck.title(ply) for ply in deck.order] == [
        f"{name} fibre_direction_{k}" for name in names for k in (1, 2)
    ]
    assert [deck.plies[ply][1][0] for ply in deck.order] == ["1", "1", "2", "2"]
    assert report.exports[0]["details"]["materials"] == {"1": names[0], "2": names[1]}
    counts = {corner_count(name): len(cells) for name, cells in target.blocks}
    assert len(deck.of["SHELL"][0][1]) == counts[4] and len(deck.of["SH3N"][0][1]) == counts[3]
    x = dict(zip(target.cell_ids.tolist(), target.centroids[:, 0].tolist()))
    for ply, shear in ((0, 0.3), (1, -0.5)):
        first, second = (deck.layers(2 * ply + k) for k in (1, 2))
        assert set(first) == set(second)
        for number in first:
            cosine = abs(first[number][0] @ second[number][0])
            assert np.arccos(cosine) == pytest.approx(0.5 * np.pi - abs(shear), abs=1e-6)
            formed = first[number][1] + second[number][1]
            expected = thickness_at(ply, x[number])
            assert formed == pytest.approx(expected, rel=2e-2 if ply else 1e-9)
