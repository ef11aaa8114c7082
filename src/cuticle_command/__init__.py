"""The command `cuticle`: it answers Ctrl-C before it imports the package, which takes longer than this module."""

import os
import signal


def _stop(*_: object) -> None:
    os.write(2, b"cuticle: stopped\n")
    os._exit(130)  # nothing has been written yet, and an import that is broken off may become any error


if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _stop)


def main() -> None:
    """Run the command line.

    With one thread for BLAS: the package has threads of its own for what takes long, its matrices are small, and two threads
    that multiply such ones wait for one another.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from cuticle.cli import main as run

    run()
