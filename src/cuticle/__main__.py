"""`python -m cuticle`: the command line."""

from cuticle.cli import main

main()
