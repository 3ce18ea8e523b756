"""Name that written code imports: `studies.sweep.workers` under its earlier path."""

from studies.sweep.workers import run, run_in_processes

__all__ = ["run", "run_in_processes"]
