"""The command ``haff`` from Python, and the part of the command that is written in Python.

*What is here.* :mod:`.call` finds the command and runs it, :mod:`.runs` is :func:`haff.run` and :func:`haff.resume`,
:mod:`.sweeps` is :func:`haff.sweep`, :mod:`.packings` is :func:`haff.pack`. :mod:`.main` is ``haff plot``,
``haff export`` and ``haff view``.

*What to change here.* An option of the command that Python should have, too.

*May import* all rooms but ``live``.

*Begin with* :mod:`.runs`.
"""
