"""python -m vm_calibrate runs vm-calibrate."""

import sys

from .cli import main

if __name__ == "__main__":
    sys.exit(main())
