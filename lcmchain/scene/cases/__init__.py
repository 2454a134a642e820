"""Commented scenes to start from: what ``lcmchain new`` writes.

::

    options ─▶ moulds, simple_tools: what is not given ─▶ sheet: templates/ ─▶ scene.toml
"""
