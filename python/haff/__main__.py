"""The commands of the package: ``haff plot``, ``export`` and ``view`` are ``python -m haff plot``, …."""

from __future__ import annotations

import sys

from .command.main import main

if __name__ == "__main__":
    sys.exit(main())
