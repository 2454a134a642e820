"""From text to a scene, and from a wrong entry to a sentence that names it.

::

    scene.toml ─▶ read ─▶ Scene, with what was given and what was defaulted
                   ├── overrides: --set key=value changes the document
                   └── explain: which table and entry stand at a location of the document,
                       what pydantic finds wrong with them, and what to do
    a table in a file of its own, or the scene that a result holds ─▶ single_tables
    Scene ─▶ json_schema: for completion and checks in editors
"""
