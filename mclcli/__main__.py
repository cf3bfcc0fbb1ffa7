"""``python -m mclcli`` is ``mcl``; the way in, which knows how to be interrupted before anything else is there."""

from __future__ import annotations


def main() -> None:
    """Run the command line; an interrupt while it is still being imported ends as quietly as any later one."""
    import sys

    try:
        import warnings

        from mclcli.cli import main as start
    except KeyboardInterrupt:
        sys.exit(130)
    if "--debug" not in sys.argv:
        warnings.simplefilter("ignore")  # NumPy's are for programmers; what a user must know is said in mcl's own words
    start()


if __name__ == "__main__":
    main()
