"""Validation of haff against the literature: long runs, held against theory and published simulation by z-score.

``scripts/validate`` runs it. A *part* (:mod:`validation.parts`) makes its runs through a
:class:`~validation.runs.Context` and returns :class:`~validation.rows.Row` objects: what was measured, what is expected
and from where.
"""
