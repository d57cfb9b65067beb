"""``ertskin VERB [-m] [group=choice] [key=value]``: hands each verb to its Hydra application."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib
import os
import sys
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ertskin import __version__
from ertskin.commands import verbs
from ertskin.configuration import choices, config_dir, groups
from ertskin.errors import JobFailed, PastHydra, StepRefused, UserError
from ertskin.interrupts import unwind_on_sigterm

if TYPE_CHECKING:
    from omegaconf import DictConfig

USAGE = "usage: ertskin VERB [-m] [group=choice] [key=value]"
SWEEP_FLAGS = {"-m", "--multirun"}
OPTIONS_WITH_VALUE = {
    "--config-dir",
    "-cd",
    "--config-path",
    "-cp",
    "--config-name",
    "-cn",
    "--cfg",
    "-c",
    "--package",
    "-p",
}
# Folder of configurations the commands write for one another (a calibration, a verdict), searched beside ours.
WRITTEN_CONFIGS = Path("runs/conf")


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the exit status: 0, 1 (a job failed), 2 (a request can't be met) or 130 (Ctrl-C)."""
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        status = _dispatch(arguments)
        sys.stdout.flush()
        return status
    except KeyboardInterrupt:
        print("ertskin: stopped", file=sys.stderr)
        return 130
    except PastHydra as escaped:
        return _report(escaped.__cause__)
    except Exception as error:
        return _report(error)


def _dispatch(arguments: list[str]) -> int:
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print(_overview())
        return 0
    if arguments[0] == "--version":
        print(f"ertskin {__version__}")
        return 0
    if arguments[0] in ("--completion", "--complete"):
        from ertskin.completion import completions, script

        word = arguments[1] if len(arguments) > 1 else ""
        print(script(word) if arguments[0] == "--completion" else "\n".join(completions(word)))
        return 0
    verb, rest = arguments[0], arguments[1:]
    known = verbs()
    if verb not in known:
        raise UserError(f"no command '{verb}': choose one of {', '.join(known)}")
    if any(argument in ("-h", "--help") for argument in rest):
        print(_verb_help(verb, known[verb]))
        return 0
    _run(verb, rest)
    return 0


def _run(verb: str, arguments: list[str]) -> None:
    # Threads that wait for one another must sleep: spinning, two of them beside a busy neighbour crawl.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra then raises, and the message is ours to word.
    import hydra

    unwind_on_sigterm()
    extra = [f"hydra.searchpath=[file://{WRITTEN_CONFIGS.resolve()}]"] if WRITTEN_CONFIGS.is_dir() else []
    extra.append(f"hydra.sweep.dir=runs/sweep/{sweep_key(verb, arguments)}")
    command = importlib.import_module(f"ertskin.commands.{verb}")
    # A command may take a word that Hydra would not, and say it in Hydra's words.
    words = command.reworded(arguments) if hasattr(command, "reworded") else arguments
    sys.argv = [f"ertskin {verb}", *_options_first([*words, *extra])]
    application = hydra.main(version_base="1.3", config_path=str(config_dir()), config_name=verb)
    with contextlib.nullcontext() if _may_ask_for_sweep(words) else _composed_once():
        application(_reporting(command.run))()


def _may_ask_for_sweep(words: list[str]) -> bool:
    """Whether a file may say ``hydra.mode``: an experiment's, or one in a folder of the person's own."""
    return any(word.lstrip("+").startswith(("experiment=", "hydra", "-")) for word in words)


@contextlib.contextmanager
def _composed_once() -> Iterator[None]:
    """Hydra composes the configuration a first time only to read ``hydra.mode``; None tells it that none is given."""
    from hydra._internal.hydra import Hydra

    asked = Hydra.get_mode
    Hydra.get_mode = lambda self, config_name, overrides: None  # type: ignore[method-assign]
    try:
        yield
    finally:
        Hydra.get_mode = asked  # type: ignore[method-assign]


def _options_first(arguments: list[str]) -> list[str]:
    """Hydra's parser takes overrides in one piece only; a person may put -m or --config-dir between them."""
    options, overrides = [], []
    words = iter(arguments)
    for word in words:
        if not word.startswith("-"):
            overrides.append(word)
            continue
        options.append(word)
        if word in OPTIONS_WITH_VALUE:
            options.extend(value for value in [next(words, None)] if value is not None)
    return [*options, *overrides]


def _reporting(run: Callable[[DictConfig], Any]) -> Callable[[DictConfig], Any]:
    @functools.wraps(run)
    def task(config: DictConfig) -> Any:
        from hydra.core.hydra_config import HydraConfig
        from hydra.types import RunMode

        # An experiment's file may ask for a sweep as well as a flag.
        wrap = _reporting_at_once if HydraConfig.get().mode == RunMode.MULTIRUN else _escaping
        return wrap(run)(config)

    return task


def _escaping(run: Callable[[DictConfig], Any]) -> Callable[[DictConfig], Any]:
    @functools.wraps(run)
    def task(config: DictConfig) -> Any:
        try:
            return run(config)
        except Exception as error:
            raise PastHydra from error

    return task


def _reporting_at_once(run: Callable[[DictConfig], Any]) -> Callable[[DictConfig], Any]:
    """A sweep's job: Hydra keeps a failure to itself until every other job is through, so it is said here."""

    @functools.wraps(run)
    def task(config: DictConfig) -> Any:
        try:
            return run(config)
        except Exception as error:
            from hydra.core.hydra_config import HydraConfig

            words = " ".join(HydraConfig.get().overrides.task)
            line = _users_line(error)
            if line is None:
                traceback.print_exception(error)
                line = repr(error)
            print(f"ertskin: FAILED {words}: {line}", file=sys.stderr, flush=True)
            raise JobFailed("not every job of the sweep succeeded; run it again to try those that failed") from None

    return task


def sweep_key(verb: str, arguments: list[str]) -> str:
    """Name of a sweep: the same request, whatever its launcher and the order of its words, has the same one."""
    words = sorted(word for word in arguments if word not in SWEEP_FLAGS and not word.startswith("hydra"))
    return f"{verb}-{hashlib.sha256(repr((verb, words)).encode()).hexdigest()[:12]}"


def _report(error: BaseException | None) -> int:
    if isinstance(error, BrokenPipeError):
        # Whoever read has read enough; what is left must not be flushed into the pipe at the end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    if os.environ.get("ERTSKIN_TRACEBACK"):
        traceback.print_exception(error)
    if isinstance(error, StepRefused):
        return 2
    line = _users_line(error)
    if line is None:
        traceback.print_exception(error)
        line = "an error in ertskin itself, shown above"
    print(f"ertskin: {line}", file=sys.stderr)
    return 2 if _users_fault(error) else 1


def _users_fault(error: BaseException | None) -> bool:
    from hydra.errors import HydraException
    from omegaconf.errors import OmegaConfBaseException

    # An error class of a module that was never imported can't have been raised.
    recording = sys.modules.get("ertskin.hardware.recording")
    kinds = (UserError, HydraException, OmegaConfBaseException, *([recording.RecordingError] if recording else []))
    return isinstance(error, kinds)


def _users_line(error: BaseException | None) -> str | None:
    """The one line that tells a person what went wrong, or None where that takes a traceback."""
    from omegaconf.errors import MissingMandatoryValue

    if isinstance(error, MissingMandatoryValue):
        key = error.full_key or str(error).rsplit(": ", 1)[-1]
        return f"'{key}' must be given: {key}=VALUE"
    if isinstance(error, JobFailed) or _users_fault(error):
        return _without_hydras_words(error) or " ".join(str(error).split())
    return None


def _without_hydras_words(error: BaseException | None) -> str | None:
    """A choice or setting that there isn't, where Hydra would list its search path and advise to add the setting."""
    from hydra.errors import ConfigCompositionException, MissingConfigException

    if isinstance(error, MissingConfigException) and error.options and "/" in (error.missing_cfg_file or ""):
        group, choice = str(error.missing_cfg_file).rsplit("/", 1)
        return f"{group}={choice}: there is no such choice; there are {', '.join(error.options)}"
    unknown = getattr(error.__cause__, "full_key", None) if isinstance(error, ConfigCompositionException) else None
    if unknown and "Could not override" in str(error):
        return f"there is no setting '{unknown}': ertskin VERB --help lists a command's groups and settings"
    return None


def _overview() -> str:
    known = verbs()
    width = max(map(len, known), default=0)
    lines = [f"  {name:<{width}}  {text.splitlines()[0] if text else ''}" for name, text in known.items()]
    return "\n".join(
        [
            "ertskin: from a recording on a soft ERT skin to a calibrated network.",
            "",
            USAGE,
            "",
            *lines,
            "",
            "ertskin VERB --help shows a command's settings and their defaults.",
            'eval "$(ertskin --completion bash)" completes commands and settings with TAB (also zsh, fish).',
            "A comma between values and -m runs them all: ertskin train -m grid=4x4,6x6 recording=FILE",
        ]
    )


def _verb_help(verb: str, text: str) -> str:
    path = config_dir() / f"{verb}.yaml"
    offered = [
        f"  {group}={'|'.join(choices(group))}" + (f"  (default {default})" if default else "")
        for group, default in groups(verb).items()
    ]
    settings = [line for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    return "\n".join(
        [
            f"usage: ertskin {verb} [-m] [group=choice] [key=value]",
            "",
            text,
            *(["", "groups:", *offered] if offered else []),
            "",
            f"settings and defaults ({path}):",
            *(f"  {line}" for line in settings),
            "",
            f"ertskin {verb} --cfg job shows the whole configuration that would be used.",
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
