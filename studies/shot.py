"""Name that written code imports: `studies.photograph.shot` under its earlier path."""

from studies.photograph.shot import Order, take

__all__ = ["Order", "take"]
