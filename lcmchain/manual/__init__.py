"""The manual: Markdown pages that ship with the package, and what turns them into HTML.

``contents`` names the pages in their order, ``markdown`` renders one page, ``site`` builds all of
them into a folder, ``generated`` writes the reference pages from the code.
"""
