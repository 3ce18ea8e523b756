"""Applications of the chain: demo, sweeps, metrics, reports and the command line."""
