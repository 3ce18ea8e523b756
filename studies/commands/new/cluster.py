"""The command `rodcone new cluster`: settings of dask.distributed."""

from pathlib import Path

from studies.commands.new.example_files import copy_example

_CLUSTER = Path(__file__).parents[2] / "data" / "dask.yaml"


def cluster(*, out: Path) -> None:
    """Copy settings of dask.distributed that suit sweeps, with the commands that start a cluster.

    Parameters
    ----------
    out
        File to write, ending in .yaml; one that exists is left alone.
    """
    copy_example(_CLUSTER, out, ".yaml")
