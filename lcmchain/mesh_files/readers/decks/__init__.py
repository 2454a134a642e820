"""Text decks of solvers: Abaqus and CalculiX, Nastran and OptiStruct, LS-DYNA, Universal files.

- ``abaqus.py``: parts and instances put into one mesh; ``abaqus_scope.py``: one part as it is read;
  ``abaqus_blocks.py``: the deck as keyword blocks.
- ``nastran.py``, with ``nastran_cards.py``, the deck as cards, and ``nastran_sets.py``.
- ``lsdyna.py``, with ``lsdyna_blocks.py``, the deck as keyword blocks.
- ``universal.py``.
- ``common.py``: lines, real numbers and sets, as all of them have them.
"""
