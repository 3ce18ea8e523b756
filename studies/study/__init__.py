"""What is asked: a study, its file, its sources, its models."""
