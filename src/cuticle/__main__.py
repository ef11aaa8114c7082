"""`python -m cuticle`: the command line."""

from cuticle_command import main

main()
