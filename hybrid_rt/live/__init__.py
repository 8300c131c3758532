"""A page on 127.0.0.1 that shows a growing picture: `hybrid_rt.live.watch.LivePage`.

Nothing here is imported unless a page is asked for.
"""
