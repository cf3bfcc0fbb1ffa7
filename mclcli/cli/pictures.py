"""Pictures on their way to a file."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from PIL.Image import Image


def save(picture: Image, target: str, inputs: Sequence[Path] = ()) -> None:
    """Write a picture as PNG, whole or not at all.

    Raises
    ------
    UsageError, InputError
        If the target cannot be written; see ``mclcli.io.traces.output``.

    """
    from mclcli.io.traces.output import open_output

    buffer = io.BytesIO()
    picture.save(buffer, format="PNG", optimize=False)
    with open_output(target, binary=True, inputs=inputs) as file:
        file.write(buffer.getvalue())
