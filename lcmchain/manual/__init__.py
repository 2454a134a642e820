"""The manual: Markdown pages that ship with the package, and what turns them into HTML.

::

    code ─▶ generated: the reference pages (scene_reference, command_reference, tables) ─▶ *.md
    *.md ─▶ contents: the pages in their order ─▶ markdown: one page ─▶ site: all, in a folder
"""
