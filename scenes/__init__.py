"""What is looked at: one builder a file, a catalogue, light levels with their sources."""
