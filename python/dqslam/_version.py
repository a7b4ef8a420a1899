"""The version of dqslam."""

__version__: str | None  # looked up when it is asked for: metadata takes long to import


def version() -> str | None:
    """Return the version of the installed package; None if it is not installed."""
    from importlib import metadata

    try:
        return metadata.version("dqslam")
    except metadata.PackageNotFoundError:
        return None


def __getattr__(name: str) -> str | None:
    if name == "__version__":
        return version()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
