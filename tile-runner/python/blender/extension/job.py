"""Files that are denoised one after the other on a thread of their own. Knows nothing of Blender, whose data only its main thread may touch."""

from __future__ import annotations

import threading
import traceback
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field


class Cancelled(Exception):
    """Stops linpred from within its progress; it leaves no half-written output then."""


@dataclass(frozen=True)
class Task:
    """One file: what is said beside the bar, and the arguments of `linpred.denoise_file`."""

    label: str
    arguments: dict[str, object]


@dataclass
class Outcome:
    """What became of the files, complete once the job has ended."""

    done: int = 0
    cancelled: bool = False
    failures: list[str] = field(default_factory=list)
    # in the order in which they came; what holds for every frame is said once
    notes: dict[str, None] = field(default_factory=dict)


class Job:
    """Runs tasks in the background. A file that fails does not stop the others."""

    def __init__(self, tasks: Sequence[Task], denoise_file: Callable[..., object], note: type[Warning]) -> None:
        """`note` is the class of warnings that are told to the user."""
        self.outcome = Outcome()
        self.fraction = 0.0
        self.label = tasks[0].label
        self._tasks = tasks
        self._denoise_file = denoise_file
        self._note = note
        self._stop = threading.Event()
        # waited for in place of the thread: joining one takes it for ended once Ctrl-C has interrupted that (Python before 3.13)
        self._ended = threading.Event()
        # a daemon: whatever happens, Blender can be left
        self._thread = threading.Thread(target=self._run, name="linpred", daemon=True)

    def start(self) -> None:
        """Begins."""
        self._thread.start()

    def cancel(self) -> None:
        """Asks the job to end at the next row of pixels."""
        self._stop.set()

    def wait(self, seconds: float | None = None) -> bool:
        """Waits for the end, or so many seconds; whether the job has ended."""
        return self._ended.wait(seconds)

    def _run(self) -> None:
        try:
            self._denoise_all()
        finally:
            self._ended.set()

    def _denoise_all(self) -> None:
        for index, task in enumerate(self._tasks):
            if self._stop.is_set():
                self.outcome.cancelled = True
                return
            self.label = task.label
            try:
                self._denoise(index, task)
                self.outcome.done += 1
            except Cancelled:
                self.outcome.cancelled = True
                return
            except (ValueError, OSError, MemoryError) as error:
                # of a sequence linpred keeps by frame what went wrong
                reasons = getattr(error, "failures", {0: error}).values()
                self.outcome.failures += [str(reason) or type(reason).__name__ for reason in reasons]
            except Exception as error:  # noqa: BLE001
                # not foreseen: the user gets a sentence in any case, and the console keeps where it happened
                traceback.print_exc()
                self.outcome.failures.append(f"unexpected {type(error).__name__}: {error}")

    def _denoise(self, index: int, task: Task) -> None:
        def told(done_rows: int, all_rows: int) -> None:
            if self._stop.is_set():
                raise Cancelled
            self.fraction = (index + done_rows / max(all_rows, 1)) / len(self._tasks)

        # "always": Python would say what holds for two files only once, and a second run would be told nothing
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", self._note)
            try:
                self._denoise_file(**task.arguments, progress=told)
            finally:
                notes = (str(warning.message) for warning in caught if issubclass(warning.category, self._note))
                self.outcome.notes.update(dict.fromkeys(notes))
