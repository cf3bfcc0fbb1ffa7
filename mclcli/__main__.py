"""``python -m mclcli`` is ``mcl``; the entry point, which handles interrupts before anything else is imported."""

from __future__ import annotations


def main() -> None:
    """Run the command line; an interrupt while it is still being imported ends as quietly as any later one."""
    import sys

    try:
        import warnings

        from mclcli.cli import main as start

        if "--debug" not in sys.argv:
            warnings.simplefilter("ignore")  # NumPy's are for programmers; mcl says what a user must know itself
        start()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
