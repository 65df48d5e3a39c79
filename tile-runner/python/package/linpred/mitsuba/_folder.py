"""What a loop keeps beside its output, so that it can go on after whatever ended it.

Every file appears whole: it is written under another name and renamed. What is to be said of a file is written to ``loop.json`` first, so that a file that is
there has its entry; an entry without its file is that of a file which is about to be made again, with the same bits.
"""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any, Callable, Mapping

from linpred._errors import InputError

JOURNAL = "loop.json"
OWN = re.compile(r"(part-)?(pass-\d+|map-\d+|all(-\d+)?)\.exr(\.part)?|part-loop\.json")
"""What a loop calls its files, whole or not, but for the journal."""
FORMAT = 1
"""Of the journal; another is not read."""


class Folder:
    """The folder of a loop. Raises InputError if what is in it is of another loop, OSError if it cannot be read or written."""

    def __init__(self, path: Path, identity: Mapping[str, Any], restart: bool) -> None:
        self.path = path
        journal = path / JOURNAL
        if path.is_dir() and not journal.is_file() and any(path.iterdir()):
            raise InputError(f"{path} is there, and no loop has made it: write to another output, or move it away")
        if restart:
            self.remove()
        path.mkdir(exist_ok=True)
        self._journal: dict[str, Any] = {"format": FORMAT, "identity": dict(identity), "spent": 0.0, "files": {}}
        if journal.is_file():
            self._journal = self._known(journal, identity)
        else:
            self._write_journal()

    def _known(self, journal: Path, identity: Mapping[str, Any]) -> dict[str, Any]:
        """The journal that is there, if it is of this loop."""
        anew = "begin anew (restart), or write to another output"
        try:
            found: dict[str, Any] = json.loads(journal.read_text(encoding="utf-8"))
            if found["format"] != FORMAT:
                raise InputError(f"{journal}: written by another version of linpred; {anew}")
            was, files, spent = found["identity"], found["files"], found["spent"]
        except (json.JSONDecodeError, UnicodeDecodeError, KeyError, TypeError) as error:
            raise InputError(f"{journal}: not the journal of a loop ({error}); {anew}") from error
        if not (isinstance(was, dict) and isinstance(files, dict) and isinstance(spent, (int, float))):
            raise InputError(f"{journal}: not the journal of a loop; {anew}")
        for name, wanted in identity.items():
            if was.get(name) != wanted:
                raise InputError(f"{self.path} holds passes with another {name} ({_short(was.get(name))}; this one: {_short(wanted)}); {anew}")
        return found

    @property
    def spent(self) -> float:
        """Seconds that the loop has taken up to its last entry, over all its runs."""
        return float(self._journal["spent"])

    def of(self, name: str) -> dict[str, Any] | None:
        """What is said of a file, if it is there."""
        entry = self._journal["files"].get(name)
        return dict(entry) if entry is not None and (self.path / name).is_file() else None

    def add(self, name: str, make: Callable[[Path], dict[str, Any]], spent: Callable[[], float]) -> dict[str, Any]:
        """Makes a file: ``make`` writes it to the path that it is given, and returns what is to be said of it."""
        # the name still ends as its format wants
        part = self.path / f"part-{name}"
        entry = make(part)
        self._journal["files"][name] = entry
        self._journal["spent"] = spent()
        self._write_journal()
        os.replace(part, self.path / name)
        return entry

    def _write_journal(self) -> None:
        part = self.path / f"part-{JOURNAL}"
        part.write_text(json.dumps(self._journal, indent=1) + "\n", encoding="utf-8")
        os.replace(part, self.path / JOURNAL)

    def remove(self) -> None:
        """Removes what loops have made, the journal last; the folder, too, unless somebody has put other things into it."""
        if not self.path.is_dir():
            return
        for file in self.path.iterdir():
            if OWN.fullmatch(file.name):
                file.unlink()
        (self.path / JOURNAL).unlink(missing_ok=True)
        if not any(self.path.iterdir()):
            self.path.rmdir()


def _short(value: object) -> str:
    text = " x ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
    return text if len(text) <= 16 else f"{text[:12]}..."
