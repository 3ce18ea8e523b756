"""What is asked: a study, its file, its sources, its models."""

from studies.study.study import RenderLimits, SceneChoice, Study

__all__ = ["RenderLimits", "SceneChoice", "Study"]
