"""The whole of a render: passes, limits, a picture and its report."""
