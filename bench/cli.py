"""The command line: `bench run`, `bench detect` and the others. A user's error is one sentence and status 2."""

import argparse
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Sequence
from importlib import import_module
from typing import NoReturn

from ..core.errors import InputError, Interrupted, SlamduelError, nearest
from .words.ascii import plain_where_needed

COMMANDS = {
    "run": ("run backends on datasets and write a report", ".commands.run"),
    "list": ("list backends and datasets with their options", ".commands.list"),
    "show": ("draw a log and print its numbers", ".commands.show"),
    "noise": ("measure the noise of logs, and write a log whose stated noise holds", ".commands.noise"),
    "validate": ("list everything that is wrong with a log, with file and row", ".commands.validate"),
    "fetch": ("download a published log from its publisher", ".commands.fetch"),
    "export": ("write a log, or the cells of a study or run, for other programs", ".commands.export"),
    "detect": (
        "turn a recording of a camera, depth camera or laser scanner into a log with a report",
        ".commands.detect",
    ),
    "render": ("write a rendered drive as frames, video or ROS bag, with its truth", ".commands.render"),
    "markers": ("print markers, or a calibration board, at true size", ".commands.markers"),
    "calibrate": ("calibrate a camera from views of a ChArUco board or chessboard", ".commands.calibrate"),
    "speed": ("time a step of every backend, or of the front end, against stated references", ".commands.speed"),
    "ablate": ("run a study to its answer, on this machine or a cluster", ".commands.ablate"),
    "suite": ("run a suite of the benchmark into its site, or check and enter somebody's results", ".commands.suite"),
    "check": ("run the conformance suite on a backend", ".commands.check"),
    "report": ("write the report of a run's or a study's folder again", ".commands.report"),
    "compare": ("list regressions and gains between two runs, for a pull request or CI", ".commands.compare"),
    "map": ("write maps of a run on logs of laser scanners or depth cameras, by each backend's path", ".commands.map"),
    "replay": ("show a run step by step, backends side by side, as a page, a film or a recording", ".commands.replay"),
}
"""Name -> help, and the module with `arguments(parser)` and `main(namespace)`, imported on demand."""

SOON = 0.05
"""s until a lost interrupt is sent again."""


class _Parser(argparse.ArgumentParser):
    """A parser for whose options a value that cannot be read is one sentence, as for all other bad input."""

    def error(self, message: str) -> NoReturn:
        """Raises InputError for an option; a name that is missing ends with the command's usage."""
        if message.startswith("argument -"):
            raise InputError(f"{self.prog}: {message.removeprefix('argument ')}.")
        super().error(message)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs a command; returns its exit status."""
    given = sys.argv[1:] if argv is None else list(argv)
    plain_where_needed()
    parser = _Parser(
        prog="bench",
        description="The same robot log through several SLAM backends, and a verdict that holds up.",
        epilog="bench COMMAND --help has details. bench run alone runs five backends on two built-in datasets.",
    )
    chosen = next((word for word in given if not word.startswith("-")), None)
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    action: Callable[[argparse.Namespace], int] | None = None
    try:
        if chosen is not None and chosen not in COMMANDS:
            raise InputError(f"there is no command {chosen!r}; {nearest(chosen, COMMANDS)}")
        for name, (summary, module) in COMMANDS.items():
            command = subparsers.add_parser(
                name, help=summary, description=summary[0].upper() + summary[1:] + ".", allow_abbrev=False
            )
            if name == chosen:
                implementation = import_module(module, __package__)
                implementation.arguments(command)
                action = implementation.main
        # Figures are drawn without a backend, and one that a Jupyter kernel names for itself may not be installed here.
        os.environ.pop("MPLBACKEND", None)
        sys.path.append(os.getcwd())  # so that my_module:build is found in the folder one stands in
        namespace, more = parser.parse_known_args(given)
        if more:
            _refuse(subparsers.choices[namespace.command], more)
        assert action is not None  # argparse has refused every other command
        with ended_gently():
            return action(namespace)
    except Interrupted as error:
        print(f"bench: interrupted; {error}.", file=sys.stderr)
        return 130
    except SlamduelError as error:
        print(f"bench: {str(error).removeprefix('bench ')}", file=sys.stderr)
        return 2
    except BrokenPipeError:  # the reader of our output, head for one, has gone
        sys.stderr.close()
        return 0
    except OSError as error:  # a full disk, a folder that has gone: the record keeps what was finished before
        print(f"bench: {error.filename or 'a file'}: {error.strerror or error}.", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("bench: interrupted.", file=sys.stderr)
        return 130


def _refuse(command: argparse.ArgumentParser, words: Sequence[str]) -> NoReturn:
    """Ends with what is wrong with words that a command does not take."""
    known = [name for action in command._actions for name in action.option_strings]  # pyright: ignore[reportPrivateUsage]
    first = words[0]
    if first.startswith("-"):
        raise InputError(f"{command.prog}: there is no option {first!r}; {nearest(first.partition('=')[0], known)}")
    raise InputError(
        f"{command.prog}: found {first!r}, which belongs to no option; several names are joined by commas, and a "
        "pattern of files is put in quotes."
    )


@contextlib.contextmanager
def ended_gently() -> Generator[None]:
    """Makes SIGTERM and SIGHUP, as from a batch system or a closing terminal, end the command as Ctrl-C does.

    An interrupt that comes in a callback from C, as while LLVM compiles, is lost there, and sent again.
    """
    ours: list[signal.Signals] = []
    hook = sys.unraisablehook

    def again(lost: "sys.UnraisableHookArgs") -> None:
        if lost.exc_type is not KeyboardInterrupt:
            hook(lost)
            return
        to = threading.main_thread().ident or 0
        timer = threading.Timer(SOON, signal.pthread_kill, (to, signal.SIGINT))  # sent at once, it would be lost here
        timer.daemon = True
        timer.start()

    if threading.current_thread() is threading.main_thread():
        ours = [one for one in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(one) == signal.SIG_DFL]
    for one in ours:
        signal.signal(one, signal.default_int_handler)
    sys.unraisablehook = again
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for one in ours:
            signal.signal(one, signal.SIG_DFL)


if __name__ == "__main__":
    sys.exit(main())
