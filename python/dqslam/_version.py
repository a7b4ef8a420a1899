"""The version of dqslam."""


def version() -> str | None:
    """Return the version of the installed package; None if it is not installed."""
    from importlib import metadata

    try:
        return metadata.version("dqslam")
    except metadata.PackageNotFoundError:
        return None
