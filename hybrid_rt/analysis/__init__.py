"""Studies: error against time, meshes against true surfaces, pictures compared.

The error metrics of a picture are in `hybrid_rt.sensor.image_metrics`.
"""
