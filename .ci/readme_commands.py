"""Prints command number N (from 1) of README: the Nth block fenced as sh."""

import pathlib
import re
import sys

blocks = re.findall(r"^```sh\n(.*?)^```$", pathlib.Path("README.md").read_text(), re.MULTILINE | re.DOTALL)
print(blocks[int(sys.argv[1]) - 1])
