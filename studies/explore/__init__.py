"""The live explorer: a camera whose picture answers while a control moves."""
