"""`python -m cuticle`: the command line."""

from cuticle.cli.app import main

main()
