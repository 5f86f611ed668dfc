"""Time of `import vm_embedded` beyond numpy, cv2 and onnxruntime: median of fresh interpreters."""

import statistics
import subprocess
import sys

RUNS = 15
PROGRAM = """
import time
import numpy, cv2, onnxruntime
started = time.perf_counter()
import vm_embedded
print(time.perf_counter() - started)
"""


def main() -> None:
    times = [
        float(subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True).stdout)
        for _ in range(RUNS)
    ]
    print(f"import vm_embedded: median {1e3 * statistics.median(times):.0f} ms, worst {1e3 * max(times):.0f} ms")


if __name__ == "__main__":
    main()
