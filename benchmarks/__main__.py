"""python -m benchmarks [name ...]: speed and accuracy beside the peers."""

from benchmarks.calibration import CALIBRATION
from benchmarks.closure import CLOSURE
from benchmarks.cluster import CLUSTER
from benchmarks.confidence import CONFIDENCE
from benchmarks.experiment import main
from benchmarks.families import FAMILIES_EXPERIMENT
from benchmarks.free_space import FREE_SPACE_EXPERIMENT
from benchmarks.held_out import HELD_OUT
from benchmarks.hidden_shape import HIDDEN_SHAPE
from benchmarks.kernels import KERNELS
from benchmarks.kinds.experiment import KINDS_EXPERIMENT
from benchmarks.left_out import LEFT_OUT
from benchmarks.page import PAGE
from benchmarks.pairs import PAIRS
from benchmarks.parts import PARTS
from benchmarks.queue import QUEUE
from benchmarks.scaling import SCALING
from benchmarks.scenes import SCENES_EXPERIMENT
from benchmarks.service_load import LOAD
from benchmarks.sizing import SIZING
from benchmarks.threads import THREADS

if __name__ == "__main__":
    main(
        [
            KERNELS,
            PAIRS,
            HELD_OUT,
            PARTS,
            SCENES_EXPERIMENT,
            FAMILIES_EXPERIMENT,
            LEFT_OUT,
            FREE_SPACE_EXPERIMENT,
            KINDS_EXPERIMENT,
            CLOSURE,
            CONFIDENCE,
            CALIBRATION,
            HIDDEN_SHAPE,
            SCALING,
            THREADS,
            LOAD,
            QUEUE,
            CLUSTER,
            SIZING,
            PAGE,
        ],
        "python -m benchmarks",
    )
