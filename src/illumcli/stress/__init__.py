"""The numerical stability suite: scenes, rays, models and meshes at the limits of their ranges."""
