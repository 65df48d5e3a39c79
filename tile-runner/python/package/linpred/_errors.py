"""What goes wrong with files."""

from __future__ import annotations

from typing import TYPE_CHECKING

from linpred._linpred import InputError

if TYPE_CHECKING:
    from linpred._files import FileReport

__all__ = ["InputError", "InputWarning", "SequenceError"]


class InputWarning(UserWarning):
    """A file is denoised, but something about it is not as it should be."""


class SequenceError(InputError):
    """Some frames of a sequence could not be denoised; the others are."""

    failures: dict[int, Exception]
    """Of each frame that failed, by its number, why."""
    reports: list[FileReport]
    """What was done with the other frames."""

    def __init__(self, failures: dict[int, Exception], reports: list[FileReport]) -> None:
        # what pickle and copy make another of; the words are in __str__
        super().__init__(failures, reports)
        self.failures = failures
        self.reports = reports

    def __str__(self) -> str:
        failures = self.failures
        frames, first = len(failures) + len(self.reports), next(iter(failures))
        return f"{len(failures)} of {frames} frames failed; frame {first}: {failures[first]}"
