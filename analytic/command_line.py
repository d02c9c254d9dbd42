"""What the command lines of this project share: help that keeps its units, and one sentence for what cannot be used."""

from __future__ import annotations

import errno
import os
import re
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Annotated, Any, get_args

import typer
from typer.core import TyperGroup

from analytic.standard_streams import printable, standard_streams
from analytic.whole_file import UnwrittenError

BAD_INPUT = 2
"""Exit code of an input that cannot be used."""

INTERRUPTED = 130
"""Exit code after Ctrl-C, and after what ends a process from outside."""


def other_ends() -> list[signal.Signals]:
    """Signals beside Ctrl-C that ask a process to end; not that of a closed terminal where `nohup` has it ignored."""
    found = [signal.SIGTERM]
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # Windows has none
        found.append(signal.SIGHUP)
    return found


@contextmanager
def ended_as_by_ctrl_c() -> Iterator[None]:
    """Let what asks the process to end do what Ctrl-C does, so that everything is tidied up on the way."""
    if threading.current_thread() is not threading.main_thread():  # which alone may receive signals
        yield
        return

    def end(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = {number: signal.signal(number, end) for number in other_ends()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def refusals() -> Iterator[None]:
    """Refuse with its own sentence what raises a ValueError, which all bad inputs do, and what the disk refuses."""
    try:
        yield
    except (ValueError, UnwrittenError) as error:
        raise typer.BadParameter(str(error)) from None
    except BrokenPipeError:  # the reader of a pipe has seen enough; that is no mistake
        raise
    except OSError as error:
        raise typer.BadParameter(refused(error)) from None


def refused(error: OSError) -> str:
    """What the system refuses, in one sentence; an error that has a sentence of its own keeps it."""
    if not error.strerror or isinstance(error, UnwrittenError):
        return str(error)
    place = f"{error.filename}: " if error.filename else ""
    return f"{place}{error.strerror}".rstrip(".") + "."


def complain(sentence: str) -> None:
    """Print a sentence to standard error, red on a terminal."""
    typer.secho(printable(sentence), err=True, fg=typer.colors.RED)


def tell(text: str) -> None:
    """Print to standard output; control characters that came with a title or a file's name are shown as codes."""
    typer.echo(printable(text))


def _tell_versions(asked: bool) -> None:
    if asked:
        from analytic.version import versions

        typer.echo(versions())
        raise typer.Exit


def add_version(app: typer.Typer) -> None:
    """Give a command line the option --version."""

    @app.callback()
    def options(
        version: Annotated[
            bool,
            typer.Option("--version", callback=_tell_versions, is_eager=True, help="Tell the version, and Warp's."),
        ] = False,
    ) -> None: ...


class CommandLine(TyperGroup):
    """A command line that answers what it cannot use with one sentence, which names options as they were typed."""

    def __init__(self, **attributes: Any):
        super().__init__(**attributes)
        self._commands = list(_all_commands(self))
        self._typed: dict[str, str] = {}
        for command in self._commands:
            _as_plain_text(command)

    def main(self, *arguments: Any, **options: Any) -> Any:
        os.environ["MPLBACKEND"] = "agg"  # pictures go to files; what else is set may not be there
        with standard_streams() as output, ended_as_by_ctrl_c():
            try:
                return super().main(*arguments, **options)
            except SystemExit as end:
                if end.code or output.failure is None or getattr(output.failure, "errno", None) == errno.EPIPE:
                    raise
                reason = getattr(output.failure, "strerror", None) or output.failure
                complain(f"Standard output cannot be written: {reason}.")
                raise SystemExit(BAD_INPUT) from None

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        words = {word.partition("=")[0] for word in args}
        options = ((option, one) for command in self._commands for one in command.params for option in one.opts)
        self._typed = {one.name: option for option, one in options if option in words and option.startswith("-")}
        with self._one_sentence():
            return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: Any) -> Any:
        with self._one_sentence():
            return super().invoke(ctx)

    def allowed(self, parameter: Any) -> str:
        """What an option or argument takes, in words."""
        kind = parameter.type_descriptor
        if kind.choices is not None:
            return "one of " + ", ".join(str(getattr(choice, "value", choice)) for choice in kind.choices)
        types = get_args(kind.annotation) or (kind.annotation,)
        words = "a whole number" if int in types else "a number" if float in types else "given"
        bounds = [
            f"{name} {bound:g}"
            for name, bound in (("at least", parameter.min), ("at most", parameter.max))
            if bound is not None
        ]
        return f"{words} {' and '.join(bounds)}".rstrip()

    @contextmanager
    def _one_sentence(self) -> Iterator[None]:
        try:
            yield
        except typer.TyperException as error:
            sentence = self._sentence(error)
            if sentence:  # else it is a call without arguments, which has printed the help
                complain(sentence)
            raise typer.Exit(error.exit_code) from None
        except MemoryError as error:
            complain(f"There is not enough memory: {error or 'none is left'}".rstrip(".") + ".")
            raise typer.Exit(BAD_INPUT) from None
        except BrokenPipeError:
            raise
        except OSError as error:
            complain(refused(error))
            raise typer.Exit(BAD_INPUT) from None

    def _sentence(self, error: typer.TyperException) -> str:
        parameter = getattr(error, "param", None)
        if isinstance(error, typer.BadParameter) and parameter is None:
            return self._as_typed(error.message)
        if parameter is None:
            message, where = error.format_message().rstrip("."), getattr(error, "ctx", None)
            if not message or message.endswith("?"):
                return message
            return f"{message}." if where is None else f"{message}; see {where.command_path} --help."
        problems: list[Any] = getattr(error.__cause__, "errors", list)()
        said = getattr(error, "message", "")  # of a path; empty where the parameter is missing
        if said and not problems:
            unreadable = re.fullmatch(r"\w+ (['\"])(.*)\1 is not readable\.", said)
            return f"{unreadable[2]} cannot be read: Permission denied." if unreadable else said
        name = self._typed.get(parameter.name) or (parameter.metavar or parameter.name)
        value = f"= {problems[0]['input']} is not allowed" if problems else "is missing"
        return f"{name} {value}; it must be {self.allowed(parameter)}."

    def _as_typed(self, sentence: str) -> str:
        """The sentence with options in place of the names by which functions know them, where they were typed."""
        for name, option in self._typed.items():
            sentence = re.sub(
                rf"^{name} is (.+?), it must be", rf"{option} = \1 is not allowed; it must be", sentence, flags=re.M
            )
            # Inside the sentence a name of one word would be taken for any other word.
            place = r"(?<![\w.-])" if "_" in name else "^"
            sentence = re.sub(rf"{place}{name}(?= (?:is|and|needs|=) )", option, sentence, flags=re.M)
        return sentence


def _all_commands(command: Any) -> Iterator[Any]:
    yield command
    for one in getattr(command, "commands", {}).values():
        yield from _all_commands(one)


def _as_plain_text(command: Any) -> None:
    """Let the help of a command say what its source says: Rich takes "[m]" for markup, and a line's end for a break."""

    def plain(text: str | None) -> str | None:
        # As rich.markup.escape, whose import would cost a call without --help a third of its time.
        return text and re.sub(r"\[(?=[a-z#/@][^[]*])", r"\\[", re.sub(r"(?<!\n)\n(?!\n)", " ", text))

    command.help, command.short_help, command.epilog = map(plain, (command.help, command.short_help, command.epilog))
    for parameter in command.params:
        parameter.help = plain(parameter.help)
