"""The error budget: what each approximation costs, in electrons."""
