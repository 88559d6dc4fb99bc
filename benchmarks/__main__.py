"""python -m benchmarks [name ...]: speed and accuracy beside the peers."""

from benchmarks.experiment import main
from benchmarks.kernels import KERNELS
from benchmarks.pairs import PAIRS

main([KERNELS, PAIRS], "python -m benchmarks")
