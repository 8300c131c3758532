"""Reports that say something else than what was rendered."""

from hybrid_rt.rendering.report import Report


def changed(report, **entries):
    """Return a report with other entries; of those that are dicts only what is given is another."""
    merged = {
        name: {**(report[name] or {}), **entry} if isinstance(entry, dict) else entry
        for name, entry in entries.items()
    }
    return Report.from_dict(report | merged)
