"""The command line."""

from __future__ import annotations

import sys


def main() -> None:
    """Run the command line: `cuticle` and `python -m cuticle`. Ctrl-C may come while its modules are imported."""
    try:
        from cuticle.cli.app import main as run

        run()
    except KeyboardInterrupt:
        print("cuticle: stopped", file=sys.stderr)
        sys.exit(130)
