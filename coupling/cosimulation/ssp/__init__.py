"""Systems of SSP 1.0 and 2.0.

::

    *.ssp, *.ssd ─▶ structure ─▶ reading ─▶ System (system_file)
    System ─▶ writing ─▶ *.ssp

``structure`` says what the files hold: names, values, and nested systems as components with links.
"""
