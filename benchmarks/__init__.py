"""Measurements; numpy's own threads are switched off before it is loaded, since one core is what is measured."""

import os

for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[_name] = "1"
