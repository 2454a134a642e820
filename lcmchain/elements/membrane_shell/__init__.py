"""The 2D approach: superimposed membrane and rotation-free shell triangles."""
