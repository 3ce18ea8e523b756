"""Questions asked of the chain: demo sweep, metrics, report, command line."""
