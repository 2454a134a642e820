"""The flow of a filling: pressure behind a moving front in a sheet, and the time steps of it.

::

    preform, flow_medium ─▶ pairs ─▶ network ─▶ medium ─┐
    gates, vents, resin on top ─▶ boundaries, film ─────┤
    state at the start of a step ─▶ front, holes ───────┴▶ driven_flow ─▶ motion ─▶ state at its end
                                                           (pressure)
    time_step: this way twice (Heun), and anew with a shorter step where resin finds no room

From mesh and material to conductances:

- ``preform`` : surface mesh, and thickness, porosity and permeability of its cells.
  ``flow_medium`` : a layer on it, with control volumes of its own.
- ``pairs`` : which nodes conduct to each other, so that as few conductances as possible are
  negative. ``network`` : control volumes of the nodes, and the conductances between them.

What is there:

- ``state`` : all that changes while resin flows.
- ``medium`` : pores, resin and air in the control volumes.
- ``boundaries`` : gates and vents. ``film`` : resin that lies on the sheet.
- ``front`` : where the front is inside the control volumes. ``holes`` : the field around gates that
  are round holes.

What happens in a time step:

- ``pressure`` : pressure and flows behind the front, for given boundaries.
- ``driven_flow`` : model and state make a situation, and that the flow, with gates and vents that
  open, close and reach their limits.
- ``motion`` : the flow moves the resin, and what the step leaves is written into the state.
- ``time_step`` : size of the step, its two stages (Heun), and why a filling ends.
"""
