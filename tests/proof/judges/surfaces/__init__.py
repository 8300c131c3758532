"""The judges of all classes of surfaces; every module here registers its own."""
