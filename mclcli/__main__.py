"""``python -m mclcli`` is ``mcl``."""

from mclcli.cli import main

if __name__ == "__main__":
    main()
