"""A simulation in this process: :class:`haff.Simulation`.

*What is here.* :mod:`.simulation`, around the compiled module (``crates/python``), with what it is of (:mod:`.model`)
and what it has measured (:mod:`.measured`); :mod:`.forking` holds simulations while a process copies itself.

*What to change here.* What can be asked of a simulation, or done to it, between two events.

*May import* all rooms below: it is the highest one.

*Begin with* :mod:`.simulation`.
"""
