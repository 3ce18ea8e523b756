"""Light without most of its noise, and its measured error."""
