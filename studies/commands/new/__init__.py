"""The commands `rodcone new preset`, `study` and `cluster`: files to start from."""
