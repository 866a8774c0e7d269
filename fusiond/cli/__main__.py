"""`python -m fusiond.cli`, the same as `fusiond`."""

from fusiond.cli import main

main()
