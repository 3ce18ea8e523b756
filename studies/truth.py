"""Name that written code imports: `studies.metrics.truth` under its earlier path."""

from studies.metrics.truth import light_in_bands

__all__ = ["light_in_bands"]
