"""Name that written code imports: `studies.commands.cli` under its earlier path."""

from studies.commands.cli import app, main

__all__ = ["app", "main"]
