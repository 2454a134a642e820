"""The commands of lcmchain by group, and what they share on the terminal.

    arguments ─▶ a command: parse, call, report ─▶ the room that does the work

- A scene: ``new``, ``run`` (also ``lcmchain check``), ``study``.
- Its result: ``after_forming`` (``lcmchain map``, ``structure``, ``fill``), ``pattern``.
- A fabric: ``coupon`` (also ``lcmchain identify``).
- Units: ``fmu``, ``cosim`` (also ``lcmchain precice``).
- The program: ``docs``, ``verify`` (also ``lcmchain bench``).

``options`` has the options of several commands, ``terminal`` what is written and read there. Files
here import what does the work within their functions: ``lcmchain --help`` must answer at once.
"""
