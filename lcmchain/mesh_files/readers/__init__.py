"""Readers of mesh files, one kind of file each."""
