"""From text to a scene, and from a wrong entry to a sentence that names it.

::

    scene.toml ─▶ read ─▶ Scene, with what was given and what was defaulted
                   ├── overrides: --set key=value changes the document
                   ├── walk: which table, entry and choice stand at a place of the document
                   └── explain: what pydantic finds wrong, by key, and what to do
    a table in a file of its own, or the scene that a result holds ─▶ single_tables
    Scene ─▶ json_schema: for completion and checks in editors
"""
