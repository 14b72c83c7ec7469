"""Validation of haff against the literature: long runs, compared with theory and published simulation by z-score.

``scripts/validate`` runs it. A *part* (:mod:`validation.parts`) makes its runs through a
:class:`~validation.runs.Context` and returns :class:`~validation.rows.Row` objects: measured value, expected value
and its source.
"""
