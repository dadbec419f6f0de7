"""Many independent tasks on processes of this machine or on the workers of a dask cluster."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .lack_of_memory import lacks_memory
    from .local_processes import Worker, WorkerPool
    from .pool_choice import require_workers, worker_pool
    from .task_loop import run_tasks

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
