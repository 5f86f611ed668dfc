"""Lets `python -m vm_ros` run vm-ros."""

import sys

from .cli import main

if __name__ == "__main__":
    sys.exit(main())
