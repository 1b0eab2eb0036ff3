"""Run the command line with ``python -m trueterrain``."""

from trueterrain.cli import main

main()
