"""Name that written code imports: `studies.budget.plan` under its earlier path."""

from studies.budget.plan import plan, reference_plan

__all__ = ["plan", "reference_plan"]
