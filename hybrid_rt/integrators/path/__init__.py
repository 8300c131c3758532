"""Path tracing, with light paths for what mirrors and glass throw."""
