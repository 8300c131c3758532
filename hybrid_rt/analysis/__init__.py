"""Studies that a user asks for: error against time, meshes against true surfaces, pictures compared."""
