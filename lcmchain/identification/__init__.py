"""Parameters of a fabric law from coupon tests: data, relations as fits, intervals, files.

    DATA.csv, export of a machine ─▶ data ─▶ entering_rows ─▶ a law ─▶ result ─▶ files
                                             (zeros, slip,    (fit)            (table, scene entry,
                                              tear, range)                      JSON, picture)

``from_file.py`` goes this way for each command of ``lcmchain identify``. What it uses:

- ``data.py``: columns of a coupon file in SI units, or of what testing machines write in its place.
- ``entering_rows.py``: which rows enter a fit, and from which zero they count.
- Laws, one test or family of tests each: ``shear.py`` (bias extension, picture frame),
  ``viscous_shear.py`` with ``viscous_fit.py`` (frames that resist rates), ``off_axis.py``
  (unidirectional strips), ``compaction.py`` (plates, also held ones), ``sheared_compaction.py``
  (plates on sheared fabric), ``bending.py`` with ``cantilever_tests.py`` (strips under their own
  weight), ``loops/`` (bending and shear there and back, with friction).
- ``regression.py``: weighted least squares with intervals, and whether a law describes its data.
- ``result.py``: what every law hands back; ``files.py``: what is written of it.
- ``synthetic.py``: exact coupon data with noise, to plan tests and to try all this.
"""
