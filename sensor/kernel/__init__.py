"""Expected electrons and the readout in Dr.Jit."""
