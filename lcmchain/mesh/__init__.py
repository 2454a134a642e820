"""Meshes of the sheet: the blank inside its outline, and its triangulation."""
