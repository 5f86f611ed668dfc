"""python -m vm_synth"""

import sys

from .cli import main

sys.exit(main())
