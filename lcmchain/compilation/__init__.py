"""What is changed in numba before anything is compiled, and where compiled code is kept.

:mod:`lcmchain.jit` calls these once, in this order, and gives compiled functions their options::

    threads          which library runs the threads of parallel loops, and when they start
    processor        vectors of 512 bits where nothing is lost by them; stacks and arrays that begin
                     with a line of the cache
    self_contained   a function gives the same bits from the disk as compiled here
    compiled_parts   functions of compiled code alone are not made callable from Python
    references       tuples of many arrays are handed on by their address
    standalone       heavy functions are compiled once, and linked to whatever calls them
    cache            one folder for each state of the sources, which processes share
    front_end        less time in numba's own typing

Most of them replace functions inside numba, which its versions may change: tried on 0.61.0 and
0.68.1, and an upper bound in ``pyproject.toml`` goes with them. Each file says what it replaces,
why, and what was measured; each has a test of its own.
"""
