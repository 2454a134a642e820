"""Speed of the element kernel and of whole steps of the hemisphere on this machine.

The blank, material and tools are those of ``hemisphere_holder``, formed to mid-stroke so that
contact, shear and compaction are at work.
"""

from __future__ import annotations

from lcmchain.bench.measure import KERNEL_CALLS, Measurement, kernel_work, measure
from lcmchain.compilation.threads import use_threads
from lcmchain.elements.blocks import own_blocks
from lcmchain.elements.solid_shell.geometry import curved_rows
from lcmchain.materials.st_venant_kirchhoff import (
    StiffnessLaw,
    isotropic_stiffness,
    law_of_stiffness,
)
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import CALM_CHUNKS_PER_FREQUENCY, STEPS_PER_CHUNK, Simulation

# Where whole steps are timed: the sheet lies on punch, die fillet and under the holder.
MID_STROKE = 0.06
# As many as go by while the frequency is looked at once.
WHOLE_CHUNKS = CALM_CHUNKS_PER_FREQUENCY

SCENE = """
title = "bench"
process = { time = "100 ms", frames = 2, mass_damping = "100 1/s" }
blank = { size = ["300 mm", "300 mm"], edge_length = "5 mm", height = "0.502 mm" }
material = { preset = "MD600" }
contact = { friction = 0.157 }

[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "75 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "75 mm" }

[[tools]]
name = "die"
shape = { type = "plate_with_hole", hole_radius = "77 mm", fillet_radius = "10 mm", side = "below" }

[[tools]]
name = "holder"
shape = { type = "plate_with_hole", hole_radius = "77 mm", fillet_radius = "10 mm", side = "above" }
position = "0 0 1.004 mm"
motion = { type = "guided", direction = [0, 0, -1], mass = "1.7 kg", ramp = "10 ms" }
"""


def whole_steps(name: str, simulation: Simulation) -> list[Measurement]:
    """Measure steps from the present state on, on one core and on all.

    The same steps every time, with the contact search, guards and step size between chunks.
    """
    start, begin = simulation.state.copy(), simulation.time
    span = _chunk_span(simulation, WHOLE_CHUNKS)
    simulation.advance_to(begin + span)
    element_steps = simulation.model.element_count
    element_steps *= simulation.state.step_count - start.step_count

    def work() -> None:
        simulation.restore(start)
        simulation.advance_to(begin + span)

    return [measure(name, threads, element_steps, work) for threads in (1, None)]


def at_mid_stroke(*overrides: str) -> Simulation:
    """Return the scene formed to where it is measured."""
    simulation = Simulation.from_scene(scene_from_text(SCENE, overrides=overrides))
    use_threads(None)
    simulation.advance_to(MID_STROKE)
    return simulation


def measurements() -> list[Measurement]:
    """Run all measurements: element kernels on one core, whole steps on one and on all cores."""
    simulation, triangles = at_mid_stroke(), at_mid_stroke("element=membrane-shell")
    turned = at_mid_stroke("blank.fibre_angle=30 deg")
    body, count = simulation.model.only_body(), simulation.model.element_count
    data, options = body.data, body.data.options
    parallelograms = data._replace(quick_data=None, quick_options=None, general=True)
    curved = parallelograms._replace(
        options=options._replace(flat=None, curved=True, enhanced=True),
        element_data=own_blocks(curved_rows(body.geometry)),
    )
    stiffness = isotropic_stiffness(1e6, 0.3)
    constant = curved._replace(options=curved.options._replace(conservative=None))
    isotropic = constant._replace(law=law_of_stiffness(stiffness, stiffness))
    full = constant._replace(law=StiffnessLaw(stiffness.ravel(), stiffness.ravel()))
    assert data.quick_options is not None
    published = data._replace(
        quick_options=data.quick_options._replace(director=True, conservative=None)
    )

    calls = KERNEL_CALLS * count
    found = [
        measure(f"element kernel, {name}", 1, calls, kernel_work(simulation, body_data))
        for name, body_data in (
            ("MD600, edges along the fibres", data),
            ("MD600, parallelograms", parallelograms),
            ("as published (director)", published),
            ("MD600, curved reference", curved),
            ("isotropic, curved reference", isotropic),
            ("full 6x6 law, curved reference", full),
        )
    ]
    calls = KERNEL_CALLS * triangles.model.element_count
    work = kernel_work(triangles, triangles.model.only_body().data)
    found.append(measure("triangle kernel, membrane-shell", 1, calls, work))
    found += whole_steps("whole step, hemisphere_holder", simulation)
    found += whole_steps("whole step, the same with fibres at 30 deg, cut elements", turned)
    found += whole_steps("whole step, the same with membrane-shell", triangles)
    return found


def _chunk_span(simulation: Simulation, chunks: int) -> float:
    return chunks * STEPS_PER_CHUNK * simulation.model.step_safety * simulation.critical_step()
