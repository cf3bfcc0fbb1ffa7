"""``python -m mclcli`` is ``mcl``; the entry point, which sees to streams and signals before any other import."""

from __future__ import annotations


def main() -> None:
    """Run the command line; a signal while it is still being imported ends it as quietly as any later one."""
    import sys

    try:
        from mclcli import startup

        startup.end_on_signals()
        startup.secure_streams()
        import warnings

        from mclcli.cli import main as start

        if "--debug" not in sys.argv:
            warnings.simplefilter("ignore")  # NumPy's are for programmers; mcl says what a user must know itself
        start()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
