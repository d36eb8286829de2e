"""What a detection looks like in the terminal while it goes on; nothing where nobody watches."""

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars


class Progress:
    """Frames, frames a second, markers found and the time left; a context manager."""

    def __init__(self, console: Console, frames: int | None) -> None:
        columns = (
            TextColumn("frames"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[speed]}"),
            TextColumn("{task.fields[markers]:,} markers"),
            TimeRemainingColumn(compact=True),
        )
        self._bars = Bars(*columns, console=console, transient=True, disable=console.quiet or not console.is_terminal)
        self._task = self._bars.add_task("frames", total=frames, markers=0, speed="")

    def __enter__(self) -> "Progress":
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def advance(self, markers: int) -> None:
        """One more frame has been gone through; `markers` have been found so far."""
        task = self._bars.tasks[0]
        speed = "" if task.speed is None else f"{task.speed:.0f} a second"
        self._bars.update(self._task, advance=1, markers=markers, speed=speed)
