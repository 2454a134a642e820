"""The consolidation pair as participants of the double, against the coupled system in process."""

import numpy as np
import pytest

from lcmchain.coupling.iteration import aitken, fixed_point, gauss_seidel, iqn_ils
from lcmchain.coupling.iteration.consolidation import (
    Column,
    FluidColumn,
    OutflowColumn,
    SolidColumn,
    SqueezedColumn,
    coupled_column,
    degree_of_consolidation,
    settlement_share,
)
from lcmchain.coupling.iteration.interface import PartFailed
from lcmchain.coupling.iteration.schemes import AitkenRelaxation, ConstantRelaxation, QuasiNewton
from lcmchain.coupling.precice_adapter.adapter import Adapter, Read, Write
from lcmchain.errors import InputError

from .in_memory import Configured, Coupling, InMemoryParticipant, Refused, run_pair

COLUMN = Column(cell_count=12)
STIFF = Column(cell_count=12, modulus=1e8)
MESHES = {"Solid": "Solid-Mesh", "Fluid": "Fluid-Mesh"}
RATE, PRESSURE = "volume_rate", "pore_pressure"
SLOPE, REFERENCE = "volume_rate_slope", "reference_pressure"


def configured(column, windows, **options):
    data = {"Rate": ("Solid", 1), "Slope": ("Solid", 1), "Reference": ("Solid", 1)}
    size = 0.05 * column.time_scale
    return Configured(
        "Solid", "Fluid", MESHES, data | {"Pressure": ("Fluid", 1)}, size, windows * size,
        initial=("Fluid",), **options,
    )  # fmt: skip


def solid_adapter(part, participant, split=False, **options):
    writes = [Write("Rate", "Solid-Mesh", RATE, of_window="mean")]
    if split:
        writes += [Write("Slope", "Solid-Mesh", SLOPE), Write("Reference", "Solid-Mesh", REFERENCE)]
    reads = [Read("Pressure", "Solid-Mesh", PRESSURE)]
    return Adapter(part, participant, reads, writes, name="Solid", **options)


def fluid_adapter(part, participant, split=False, **options):
    reads = [Read("Rate", "Fluid-Mesh", RATE, within="held")]
    if split:
        reads += [Read("Slope", "Fluid-Mesh", SLOPE, within="held"),
                  Read("Reference", "Fluid-Mesh", REFERENCE, within="held")]  # fmt: skip
    writes = [Write("Pressure", "Fluid-Mesh", PRESSURE)]
    return Adapter(part, participant, reads, writes, name="Fluid", **options)


def through_precice(config, column, *, split=False, substeps=(1, 1)):
    """Both columns after the coupling, and the coupling."""
    coupling = Coupling(config)
    solid, fluid = SolidColumn(column), FluidColumn(column)
    run_pair(
        coupling,
        lambda p: solid_adapter(solid, p, split, substeps=substeps[0]).run(),
        lambda p: fluid_adapter(fluid, p, split, substeps=substeps[1]).run(),
    )
    return solid, fluid, coupling


def in_process(column, scheme, windows, *, direction="pressure_from_fluid", substeps=(1, 1)):
    size = 0.05 * column.time_scale
    system = coupled_column(
        column, scheme, size, direction=direction, relative=1e-12, prediction=0,
        substeps={"solid": substeps[0], "fluid": substeps[1]},
    )  # fmt: skip
    system.advance_to(windows * size)
    return system


def agreement(system, solid, fluid):
    """Largest difference of pressures and thicknesses, relative to the largest value."""
    found = []
    for part, name, field in ((solid, "solid", "thickness"), (fluid, "fluid", PRESSURE)):
        expected = system.get_fields([f"{name}.{field}"])[f"{name}.{field}"]
        values = part.get_fields([field])[field]
        found.append(np.abs(values - expected).max() / np.abs(expected).max())
    return max(found)


SCHEMES = {
    "fixed point": (fixed_point(0.15, most_iterations=400), ConstantRelaxation(0.15)),
    "Aitken": (aitken(0.3, most_iterations=400), AitkenRelaxation(0.3)),
    "IQN-ILS": (iqn_ils(relaxation=0.3, most_iterations=400), QuasiNewton(0.3)),
}


@pytest.mark.parametrize("name", SCHEMES)
def test_an_implicit_coupling_is_that_of_the_system_in_process(name):
    scheme, acceleration = SCHEMES[name]
    config = configured(COLUMN, 6, acceleration=acceleration, most_iterations=400)
    solid, fluid, coupling = through_precice(config, COLUMN)
    system = in_process(COLUMN, scheme, 6)
    assert agreement(system, solid, fluid) < 1e-10
    assert solid.time == fluid.time == pytest.approx(config.end, rel=1e-12)
    assert len(coupling.iterations) == 6 and min(coupling.iterations) > 2
    # the criterion differs a little, so the number of iterations is about the same
    ours = [window.iterations for window in system.history.accepted]
    assert sum(coupling.iterations) == pytest.approx(sum(ours), rel=0.3)


def test_an_explicit_coupling_is_that_of_the_system_in_process():
    soft = Column(cell_count=12, modulus=1e4)
    config = configured(soft, 6, implicit=False)
    solid, fluid, _ = through_precice(config, soft)
    assert agreement(in_process(soft, gauss_seidel(), 6), solid, fluid) < 1e-12


@pytest.mark.parametrize("substeps", [(3, 1), (1, 2), (2, 3)])
def test_substeps_see_what_those_of_the_system_see(substeps):
    config = configured(COLUMN, 4, acceleration=QuasiNewton(0.3), most_iterations=400)
    solid, fluid, _ = through_precice(config, COLUMN, substeps=substeps)
    scheme = iqn_ils(relaxation=0.3, most_iterations=400)
    assert agreement(in_process(COLUMN, scheme, 4, substeps=substeps), solid, fluid) < 1e-10


def test_what_is_held_over_a_window_is_so_in_every_substep():
    """A part with memory: the volumes that a rate changes, in three sub-steps."""
    size = 1e-3 * COLUMN.time_scale
    data = {"Rate": ("Fluid", 1), "Pressure": ("Solid", 1)}
    config = Configured(
        "Fluid", "Solid", MESHES, data, size, 3 * size, implicit=False, initial=("Solid",)
    )
    fluid, solid = OutflowColumn(COLUMN), SqueezedColumn(COLUMN)
    rate, pressure = ("Rate", "{}-Mesh", RATE), ("Pressure", "{}-Mesh", PRESSURE)

    def on(side, entry):
        return entry[0], entry[1].format(side), entry[2]

    run_pair(
        Coupling(config),
        lambda p: Adapter(
            fluid, p, [Read(*on("Fluid", pressure))], [Write(*on("Fluid", rate))]
        ).run(),
        lambda p: Adapter(
            solid, p, [Read(*on("Solid", rate), within="held")], [Write(*on("Solid", pressure))],
            substeps=3,
        ).run(),
    )  # fmt: skip
    system = coupled_column(
        COLUMN, gauss_seidel(), size, direction="pressure_from_solid", prediction=0,
        substeps={"solid": 3},
    )  # fmt: skip
    system.advance_to(3 * size)
    expected = system.get_fields(["solid.thickness"])["solid.thickness"]
    values = solid.get_fields(["thickness"])["thickness"]
    np.testing.assert_allclose(values, expected, rtol=1e-12)
    assert np.abs(values - COLUMN.cell).max() > 1e-6 * COLUMN.cell


def test_the_fixed_stress_split_goes_through_precice_and_consolidates_after_terzaghi():
    config = configured(STIFF, 17, most_iterations=400)
    solid, fluid, coupling = through_precice(config, STIFF, split=True)
    system = in_process(STIFF, fixed_point(1.0), 17, direction="fixed_stress")
    assert agreement(system, solid, fluid) < 1e-10
    settled = STIFF.height - solid.get_fields(["thickness"])["thickness"].sum()
    share = settled / (STIFF.height * STIFF.load / STIFF.modulus)
    assert share == pytest.approx(settlement_share(system, STIFF), rel=1e-9)
    assert share == pytest.approx(degree_of_consolidation(0.85), abs=0.02)
    assert max(coupling.iterations) < 40


def test_the_part_goes_back_to_the_same_bits():
    """What a window leaves does not depend on how often it was gone through."""
    config = configured(COLUMN, 3, acceleration=QuasiNewton(0.3), most_iterations=400)
    coupling, seen = Coupling(config), []
    solid, fluid = SolidColumn(COLUMN), FluidColumn(COLUMN)

    class Watched(SolidColumn):
        def restore(self, saved):
            super().restore(saved)
            seen.append((self.time, self.get_fields(["thickness"])["thickness"].sum()))

    solid = Watched(COLUMN)
    steps = []
    run_pair(
        coupling,
        lambda p: steps.append(solid_adapter(solid, p).run()),
        lambda p: fluid_adapter(fluid, p).run(),
    )
    assert len(seen) == steps[0].repetitions == sum(coupling.iterations) - 3
    assert len(set(seen)) == 3 and steps[0].windows == 3
    assert steps[0].steps == steps[0].repetitions + 3


def test_a_part_that_fails_is_named_with_time_and_inputs_and_the_other_one_stops():
    class Failing(SolidColumn):
        def advance(self, step):
            if self.time > 0.09 * COLUMN.time_scale:
                raise PartFailed("made up")
            super().advance(step)

    config = configured(COLUMN, 6, acceleration=QuasiNewton(0.3), most_iterations=400)
    with pytest.raises(
        PartFailed, match='coupled part "Solid" failed at 1 s, step 0.5 s'
    ) as caught:
        run_pair(
            Coupling(config),
            lambda p: solid_adapter(Failing(COLUMN), p).run(),
            lambda p: fluid_adapter(FluidColumn(COLUMN), p).run(),
        )
    assert "made up. Its inputs: pore_pressure" in str(caught.value)


def test_values_that_are_no_numbers_are_not_written():
    class Broken(FluidColumn):
        def get_fields(self, names):
            found = super().get_fields(names)
            if self.time > 0.0:
                found[PRESSURE][3] = np.nan
            return found

    config = configured(COLUMN, 2, acceleration=QuasiNewton(0.3))
    with pytest.raises(PartFailed, match="1 of 12 values of pore_pressure are no numbers"):
        run_pair(
            Coupling(config),
            lambda p: solid_adapter(SolidColumn(COLUMN), p).run(),
            lambda p: fluid_adapter(Broken(COLUMN), p).run(),
        )


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ([Read("Pressure", "Solid-Mesh", PRESSURE)], None),
        ([], "exchanges nothing"),
        ([Read("Slope", "Solid-Mesh", PRESSURE)], 'data "Slope": has 3 components, the field'),
    ],
)
def test_what_does_not_fit_is_refused_before_the_coupling_begins(entries, message):
    config = configured(COLUMN, 2)
    config.data["Slope"] = ("Fluid", 3)
    participant = InMemoryParticipant("Solid", Coupling(config))
    if message is None:
        Adapter(SolidColumn(COLUMN), participant, entries, [])
        return
    with pytest.raises(InputError, match=message):
        Adapter(SolidColumn(COLUMN), participant, entries, [])


def test_fields_at_other_places_need_a_mesh_of_their_own():
    class Elsewhere(SolidColumn):
        def places(self, name):
            return super().places(name) + (name == RATE)

    with pytest.raises(
        InputError, match='"pore_pressure" and "volume_rate" do not lie at the same'
    ):
        solid_adapter(
            Elsewhere(COLUMN), InMemoryParticipant("Solid", Coupling(configured(COLUMN, 1)))
        )

    class Nowhere(SolidColumn):
        def places(self, name):
            return None

    with pytest.raises(InputError, match="does not say where the values"):
        solid_adapter(
            Nowhere(COLUMN), InMemoryParticipant("Solid", Coupling(configured(COLUMN, 1)))
        )


def test_the_double_refuses_what_precice_refuses():
    participant = InMemoryParticipant("Solid", Coupling(configured(COLUMN, 2)))
    for call in (
        participant.is_coupling_ongoing,
        participant.finalize,
        participant.initialize,
        lambda: participant.advance(1.0),
        participant.requires_writing_checkpoint,
    ):
        with pytest.raises(Refused):
            call()
    ids = participant.set_mesh_vertices("Solid-Mesh", COLUMN.centres())
    participant.coupling.to_first.put({"Pressure": np.zeros(12)})
    participant.initialize()
    left = participant.get_max_time_step_size()
    for call in (
        participant.initialize,
        participant.requires_initial_data,
        lambda: participant.set_mesh_vertices("Solid-Mesh", COLUMN.centres()),
        lambda: participant.read_data("Solid-Mesh", "Rate", ids, 0.0),
        lambda: participant.read_data("Solid-Mesh", "Pressure", ids, 1.01 * left),
        lambda: participant.write_data("Solid-Mesh", "Pressure", ids, np.zeros(12)),
        lambda: participant.write_data("Solid-Mesh", "Rate", ids, np.full(12, np.nan)),
        lambda: participant.advance(left),  # the checkpoint was not asked for
    ):
        with pytest.raises(Refused):
            call()
    assert participant.requires_writing_checkpoint()
    assert not participant.requires_writing_checkpoint()
    with pytest.raises(Refused, match="exceeds the window"):
        participant.advance(1.01 * left)
