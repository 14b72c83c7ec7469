"""The parts of the validation, a module each; every :class:`~validation.registry.Part` in a ``PARTS`` is found."""
