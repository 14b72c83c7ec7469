"""Output files: what HDF5 has, checked, as arrays, frames, events and tables.

*What is here.* :mod:`.stored` reads a file that may be written at the same time, or that another program has written;
:mod:`.column` is a dataset of numbers, :mod:`.layout` has the names of the layout. :mod:`.frames`, :mod:`.events`,
:mod:`.samples` and :mod:`.measure` are the parts of a file, :mod:`.scene` is its scene, :mod:`.mesh` reads the
triangles that it names, :mod:`.foreign` states of other programs. :mod:`.header` has what holds for the whole run,
which these parts need: the particles, the :mod:`.box` and the scene; :mod:`.recording` puts all of them together, and
:class:`haff.File` adds figures and exports.

*What to change here.* A dataset of the layout that Python does not read yet. Every value is checked before it is used.

*May import* ``common``, :mod:`haff.text` and :mod:`haff.errors`.

*Begin with* :mod:`.header`, then :mod:`.frames` and :mod:`.stored`.
"""
