"""Raw frames with the truth behind them: sets to train on, and a benchmark."""
