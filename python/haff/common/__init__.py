"""What all rooms use and that knows nothing of runs: arguments, output files, notebooks, words of messages.

*What is here.* :mod:`.arguments` checks what callers pass, :mod:`.output` writes a file or none, :mod:`.words` has
messages for users of the command and of Python, :mod:`.compiled` is the compiled module, if there is one.

*What to change here.* How a wrong argument is refused, or an optional library is asked for.

*May import* :mod:`haff.text` and :mod:`haff.errors` only.

*Begin with* :mod:`.arguments`.
"""
