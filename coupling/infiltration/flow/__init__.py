"""The flow of a filling: pressure behind a moving front in a sheet, and its time steps.

::

    preform, flow_medium ─▶ pairs ─▶ network ─▶ medium ─┐
    gates, vents, resin on top ─▶ boundaries, film ─────┤
    state at the start of a step ─▶ front, holes ───────┴▶ driven_flow ─▶ motion ─▶ state at its end
                                                           (pressure)
    time_step: twice (Heun), and again with a shorter step where resin has no room

From mesh and material to conductances:

- ``preform`` : surface mesh, and thickness, porosity and permeability of its cells.
  ``flow_medium`` : a layer on it, with control volumes of its own.
- ``pairs`` : which nodes conduct to each other, so that few conductances are negative.
  ``network`` : control volumes of the nodes, and the conductances between them.

State and boundaries:

- ``state`` : all that changes while resin flows.
- ``medium`` : pores, resin and air in the control volumes.
- ``boundaries`` : gates and vents. ``film`` : resin on top of the sheet.
- ``front`` : position of the front inside the control volumes. ``holes`` : the field around gates
  that are round holes.

A time step:

- ``pressure`` : pressure and flows behind the front, for given boundaries.
- ``driven_flow`` : the flow of a state, with gates and vents that open, close and reach limits.
- ``motion`` : moves the resin by the flow, and writes the result into the state.
- ``time_step`` : size of the step, its two stages (Heun), and why a filling ends.
"""
