"""python -m benchmarks.paper [name ...]: the experiments of the paper."""

from benchmarks.experiment import main
from benchmarks.paper.blade import BLADE
from benchmarks.paper.bunny import BUNNY
from benchmarks.paper.noise import NOISE
from benchmarks.paper.outliers import OUTLIERS
from benchmarks.paper.sampling import SAMPLING
from benchmarks.paper.size import SIZE
from benchmarks.paper.streets import STREETS
from benchmarks.paper.times import TIMES
from benchmarks.paper.uwa import UWA

EXPERIMENTS = [
    BUNNY,
    TIMES,
    SAMPLING,
    STREETS,
    BLADE,
    SIZE,
    OUTLIERS,
    UWA,
    NOISE,
]  # short ones first

if __name__ == "__main__":
    main(EXPERIMENTS, "python -m benchmarks.paper")
