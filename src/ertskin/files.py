"""Files that are whole or not there: written aside and renamed."""

from __future__ import annotations

import os
from pathlib import Path


def write_whole(path: Path, content: str | bytes) -> Path:
    """Put ``content``, text as UTF-8, in the place of what is at ``path``; its folder is made. Returns ``path``.

    Two processes may write the same file: each writes aside under a name of its own.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(f".{path.name}.{os.getpid()}.part")
    aside.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
    os.replace(aside, path)
    return path
