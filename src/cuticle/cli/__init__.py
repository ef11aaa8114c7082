"""The command line."""

from __future__ import annotations

import sys

from cuticle._support.extras import MissingExtraError, needed


def main() -> None:
    """Run the command line: `cuticle` and `python -m cuticle`. Ctrl-C may come while its modules are imported."""
    try:
        with needed("the command line"):
            from cuticle.cli.app import main as run
        run()
    except KeyboardInterrupt:
        print("cuticle: stopped", file=sys.stderr)
        sys.exit(130)
    except MissingExtraError as error:
        print(f"cuticle: {error}", file=sys.stderr)
        sys.exit(2)
