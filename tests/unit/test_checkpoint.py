"""Checkpoints: only the run that wrote one may go on from it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lcmchain import pipeline, provenance
from lcmchain.compilation import cache as compile_cache
from lcmchain.errors import InputError
from lcmchain.model import build_model
from lcmchain.provenance import Fingerprint, run_fingerprint, written_values
from lcmchain.scene import Scene, scene_from_text
from lcmchain.solver.checkpoint import (
    FILE_NAME,
    FORMAT,
    FRAME_FILE_NAME,
    Checkpoint,
    FrameFile,
    read_checkpoint,
    remove_checkpoint,
    write_checkpoint,
)
from lcmchain.solver.simulation import Snapshot
from lcmchain.state import State

TEXT = """
title = "sheet on a block"
process = { time = "10 ms" }
blank = { size = ["20 mm", "20 mm"], edge_length = "10 mm", height = "20 mm" }
material = { preset = "MD600" }

[[tools]]
name = "block"
shape = { type = "surface_mesh", file = "block.stl", length_unit = "mm", spacing = "5 mm" }
"""
# the same without files, built in Python
VALUES = {
    "process": {"time": "10 ms"},
    "blank": {"size": ["20 mm", "20 mm"], "edge_length": "10 mm"},
    "material": {"preset": "MD600"},
}


@pytest.fixture
def scene_file(tmp_path):
    (tmp_path / "block.stl").write_text("solid block\n", encoding="utf-8")
    return tmp_path / "scene.toml"


def built(**changes):
    return Scene.model_validate(VALUES | changes)


def fingerprint_of(text, path):
    return run_fingerprint(scene_from_text(text, path))


# --- fingerprint ----------------------------------------------------------------------------------


def test_what_decides_the_numbers_of_a_scene_is_in_its_fingerprint(scene_file):
    known = fingerprint_of(TEXT, scene_file)
    assert fingerprint_of(TEXT, scene_file) == known
    for old, new in (
        ('"10 ms"', '"11 ms"'),
        ('["20 mm", "20 mm"]', '["20 mm", "20.000000001 mm"]'),
        ('preset = "MD600"', 'preset = "MD600", thickness = "1.005 mm"'),
        ('spacing = "5 mm"', 'spacing = "4 mm"'),
    ):
        other = fingerprint_of(TEXT.replace(old, new), scene_file)
        assert other.scene != known.scene, new
        assert (other.files, other.sources) == (known.files, known.sources)
        assert other.sha256 != known.sha256
        assert known.difference(other) == "another scene (or other --set values)"
    assert known.difference(known) == ""


def test_what_is_applied_after_forming_is_not(scene_file):
    """So that a finished run serves a mended mapping."""
    (scene_file.parent / "part.vtu").write_text("mesh", encoding="utf-8")
    more = '[[mapping]]\nname = "part"\nmesh = "part.vtu"\nkind = "structure"\n'
    changed = f"# a comment\n{TEXT}\n{more}[output]\npictures = false\n".replace("on a", "upon a")
    assert fingerprint_of(changed, scene_file) == fingerprint_of(TEXT, scene_file)


def test_scenes_built_in_python_have_fingerprints(scene_file):
    assert built().source.sha256 == ""  # there is no text
    assert run_fingerprint(built()) == run_fingerprint(built(process={"time": "0.01 s"}))
    others = [
        built(process={"time": "20 ms"}),
        built(material={"preset": "MD600", "areal_mass": "601 g/m^2"}),
        built(element={"compaction_strain": "director"}),
    ]
    assert len({run_fingerprint(scene).sha256 for scene in (built(), *others)}) == 4
    text = "\n".join(TEXT.splitlines()[2:5]).replace(', height = "20 mm"', "")
    assert run_fingerprint(built()) == fingerprint_of(text, scene_file)


def test_contents_of_mesh_files_are_in_the_fingerprint(scene_file):
    known = fingerprint_of(TEXT, scene_file)
    mesh = scene_file.parent / "block.stl"
    mesh.write_text("solid block \n", encoding="utf-8")
    other = fingerprint_of(TEXT, scene_file)
    assert other.scene == known.scene and other.sha256 != known.sha256
    assert "contents of the mesh files of its tools" in known.difference(other)
    scene = scene_from_text(TEXT, scene_file)
    mesh.unlink()
    with pytest.raises(InputError, match="block.stl"):
        run_fingerprint(scene)


def test_sources_are_in_the_fingerprint(tmp_path, monkeypatch):
    folder = tmp_path / "package"
    folder.mkdir()
    (folder / "physics.py").write_text("stress = 1\n", encoding="utf-8")
    monkeypatch.setattr(compile_cache, "_package_folders", lambda: [folder])
    # asked anew, as another process would
    monkeypatch.setattr(provenance, "_sources", provenance._sources.__wrapped__)
    known = run_fingerprint(built())
    assert run_fingerprint(built()) == known
    (folder / "physics.py").write_text("stress = 2\n", encoding="utf-8")
    other = run_fingerprint(built())
    assert known.difference(other) == "other source files of lcmchain"
    assert known.sha256 != other.sha256


# --- checkpoint -----------------------------------------------------------------------------------

RUN = Fingerprint("scene", "files", "sources")


@pytest.fixture(scope="module")
def state():
    state = State.at_rest(build_model(built()))
    rng = np.random.default_rng(0)
    for array in state.as_dict().values():
        array[...] = rng.integers(1, 200, array.shape)
    return state


def checkpoint(state, folder, fingerprint=RUN, count=3):
    frames = [
        Snapshot(0.1 * k, {"a": k}, {name: array + k for name, array in state.frame().items()})
        for k in range(count)
    ]
    return Checkpoint(fingerprint, state, frames, 12.5, {"contact stiffness": 7}, FrameFile(folder))


def test_a_checkpoint_gives_back_what_was_written(state, tmp_path):
    written = checkpoint(state, tmp_path)
    write_checkpoint(tmp_path, written)
    read = read_checkpoint(tmp_path, RUN)
    for name, array in written.state.as_dict().items():
        assert getattr(read.state, name).tobytes() == array.tobytes(), name
    for one, other in zip(read.snapshots, written.snapshots, strict=True):
        assert (one.time, one.energy) == (other.time, other.energy)
        assert set(one.arrays) == set(other.arrays) == set(state.frame())
        for name, array in other.arrays.items():
            assert np.array_equal(one.arrays[name], array), name
    assert (read.fingerprint, read.wall_s) == (RUN, 12.5)
    assert read.step_history == {"contact stiffness": 7}


@pytest.mark.parametrize(
    ("part", "words"),
    [("scene", "another scene"), ("files", "mesh files"), ("sources", "other source files")],
)
def test_a_foreign_checkpoint_is_refused(state, tmp_path, part, words):
    write_checkpoint(tmp_path, checkpoint(state, tmp_path, RUN._replace(**{part: "foreign"})))
    with pytest.raises(InputError, match=words) as caught:
        read_checkpoint(tmp_path, RUN)
    assert FILE_NAME in str(caught.value) and "--resume" in str(caught.value)


def test_a_run_refuses_a_foreign_checkpoint_before_any_work(state, tmp_path, monkeypatch):
    """Also where both scenes were built in Python and have no text."""
    monkeypatch.setattr(pipeline, "Simulation", SimpleNamespace(from_scene=None))
    write_checkpoint(tmp_path, checkpoint(state, tmp_path, run_fingerprint(built())))
    other = built(process={"time": "20 ms"})
    with pytest.raises(InputError, match="another scene"):
        pipeline.run(other, tmp_path, resume=True)


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        ({"process": {"time": "20 ms"}}, "process.time"),
        ({"process": {"time": "20 ms"}, "contact": {"friction": 0.2}}, "contact.friction"),
        ({"output": {"history_interval": "2 ms"}}, "output.history_interval"),
    ],
)
def test_a_changed_scene_is_refused_by_its_first_key(state, tmp_path, changed, key):
    """A time comes last: the program may have found it from the other entries."""
    written = checkpoint(state, tmp_path, run_fingerprint(built()))
    write_checkpoint(tmp_path, replace(written, values=written_values(built())))
    other = built(**changed)
    with pytest.raises(InputError, match=f"another scene .*, which differs in {key}; run"):
        read_checkpoint(tmp_path, run_fingerprint(other), values=written_values(other))
    with pytest.raises(InputError, match=f"which differs in {key}"):
        pipeline.run(other, tmp_path, resume=True)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda content: b"no archive", "no checkpoint of lcmchain"),
        (lambda content: b"", "no checkpoint of lcmchain"),
        (lambda content: content[1:], "no checkpoint of lcmchain"),
        (lambda content: content[:-30], "checksum"),
        (lambda content: content + b"0", "checksum"),
        (lambda content: content.replace(f" {FORMAT} ".encode(), b" 2 ", 1), "format 2"),
    ],
)
def test_a_broken_checkpoint_is_refused(state, tmp_path, damage, words):
    path = write_checkpoint(tmp_path, checkpoint(state, tmp_path))
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(InputError, match=words) as caught:
        read_checkpoint(tmp_path, RUN)
    assert FILE_NAME in str(caught.value) and "without --resume" in str(caught.value)


@pytest.mark.parametrize("name", [FILE_NAME, FRAME_FILE_NAME])
def test_no_bit_of_a_checkpoint_may_differ(state, tmp_path, name):
    write_checkpoint(tmp_path, checkpoint(state, tmp_path))
    path = tmp_path / name
    content = path.read_bytes()
    rng = np.random.default_rng(7)
    first_line = list(range(content.index(b"\n") if name == FILE_NAME else 0))
    for place in [*first_line, *rng.integers(0, len(content), 40).tolist()]:
        damaged = bytearray(content)
        damaged[place] ^= 1 << rng.integers(8)
        path.write_bytes(damaged)
        with pytest.raises(InputError):
            read_checkpoint(tmp_path, RUN)
    path.write_bytes(content)
    read_checkpoint(tmp_path, RUN)


# --- frames ---------------------------------------------------------------------------------------


def same_frames(read, written):
    assert len(read.snapshots) == len(written.snapshots)
    for one, other in zip(read.snapshots, written.snapshots, strict=True):
        assert one.time == other.time
        for name, array in other.arrays.items():
            assert one.arrays[name].tobytes() == array.tobytes(), name


def test_each_frame_is_written_once(state, tmp_path):
    """The file that is written anew keeps its size, the other one grows by a frame."""
    written = checkpoint(state, tmp_path, count=20)
    later, sizes = list(written.snapshots), []
    del written.snapshots[1:]
    for count in (1, 10, 20):
        written.snapshots[:] = later[:count]
        before = (tmp_path / FRAME_FILE_NAME).stat().st_mtime_ns if count > 1 else 0
        path = write_checkpoint(tmp_path, written)
        sizes.append((path.stat().st_size, written.frame_file.length))
        assert written.frame_file.count == count
        assert (tmp_path / FRAME_FILE_NAME).stat().st_mtime_ns > before
    assert sizes[2][0] - sizes[0][0] < 100 * 19  # times and energies of the frames
    assert sizes[1][1] == 10 * sizes[0][1] and sizes[2][1] == 20 * sizes[0][1]
    stamp = (tmp_path / FRAME_FILE_NAME).stat().st_mtime_ns
    write_checkpoint(tmp_path, written)
    assert (tmp_path / FRAME_FILE_NAME).stat().st_mtime_ns == stamp
    same_frames(read_checkpoint(tmp_path, RUN), written)


def test_what_a_killed_run_left_behind_the_last_checkpoint_is_cut_off(state, tmp_path):
    written = checkpoint(state, tmp_path)
    last = written.snapshots.pop()
    write_checkpoint(tmp_path, written)
    with open(tmp_path / FRAME_FILE_NAME, "ab") as file:
        file.write(b"half a frame" * 1000)
    read = read_checkpoint(tmp_path, RUN)
    same_frames(read, written)
    read.snapshots.append(last)
    write_checkpoint(tmp_path, read)
    assert (tmp_path / FRAME_FILE_NAME).stat().st_size == read.frame_file.length
    written.snapshots.append(last)
    same_frames(read_checkpoint(tmp_path, RUN), written)


@pytest.mark.parametrize("damage", ["gone", "cut", "other"])
def test_a_checkpoint_without_its_frames_is_refused(state, tmp_path, damage):
    write_checkpoint(tmp_path, checkpoint(state, tmp_path))
    path = tmp_path / FRAME_FILE_NAME
    if damage == "gone":
        path.unlink()
    elif damage == "cut":
        path.write_bytes(path.read_bytes()[:-30])
    else:
        with open(path, "wb") as file:
            for _ in range(3 * len(state.frame())):
                np.save(file, np.zeros(1))
    with pytest.raises(InputError, match="frames of the checkpoint") as caught:
        read_checkpoint(tmp_path, RUN)
    assert FRAME_FILE_NAME in str(caught.value) and "without --resume" in str(caught.value)


def test_a_complete_run_leaves_neither(state, tmp_path):
    write_checkpoint(tmp_path, checkpoint(state, tmp_path))
    remove_checkpoint(tmp_path)
    assert list(tmp_path.iterdir()) == []
