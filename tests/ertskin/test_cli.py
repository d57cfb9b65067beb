"""The command line: what a person sees, and what a script can rely on."""

import os
import shutil
import signal
import subprocess
import sys
import time

import pytest
import yaml
from processor_time import command_s, light_imports_s

from ertskin import cli
from ertskin.commands import verbs
from ertskin.completion import completions, script
from ertskin.configuration import choices, config_dir


def test_every_command_has_a_docstring_a_body_and_a_configuration():
    assert {"train", "dashboard"} <= set(verbs())
    for verb, text in verbs().items():
        assert text.splitlines()[0].endswith("."), verb
        assert "defaults" in yaml.safe_load((config_dir() / f"{verb}.yaml").read_text()), verb


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-h"]])
def test_the_overview_names_every_command(capsys, arguments):
    assert cli.main(arguments) == 0
    shown = capsys.readouterr().out
    assert all(verb in shown for verb in verbs())


def test_the_help_of_a_command_shows_its_groups_and_settings(capsys):
    assert cli.main(["train", "--help"]) == 0
    shown = capsys.readouterr().out
    assert "model=contacts|paper|places|reciprocal" in shown
    assert "seed: 0" in shown


def test_a_group_used_twice_shows_the_default_of_the_one_that_bears_its_name(capsys):
    assert cli.main(["evaluate", "--help"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "data=anywhere|many|paper|smoke (default paper)" in shown


def test_help_needs_none_of_the_heavy_packages():
    code = "import sys; from ertskin import cli; cli.main(['train', '--help']); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"torch", "lightning", "mlflow", "scipy"} & set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["frobnicate"], "no command 'frobnicate'"),
        (["dashboard", "prot=1"], "there is no setting 'prot': ertskin VERB --help"),
        (["dashboard", "tracking=nowhere"], "tracking=nowhere: there is no such choice; there are mlflow\n"),
        (["dashboard", "port=x"], "port must be a whole number"),
        (["dashboard", "port=["], "["),
    ],
)
def test_a_persons_mistake_gives_one_line_and_status_2(capsys, workplace, arguments, words):
    assert cli.main(arguments) == 2
    out, err = capsys.readouterr()
    assert words in err
    assert err.startswith("ertskin: ")
    assert err.count("\n") == 1
    assert "Traceback" not in out + err


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("ertskin tra", ["train"]),
        ("ertskin train mod", ["model="]),
        ("ertskin train model=p", ["model=paper", "model=places"]),
        ("ertskin train -m model=paper,rec", ["model=paper,reciprocal"]),
        ("ertskin train trainer.max", ["trainer.max_epochs="]),
        ("ertskin train data=smoke data.pl", ["data.plan="]),
        ("ertskin train see", ["seed="]),
        ("ertskin train recording=run", []),
        ("ertskin frobnicate a", []),
    ],
)
def test_completions(line, expected):
    assert completions(line) == expected


COMPLETED = [
    ("ertskin train model=paper,reci", "model=paper,reciprocal"),
    ("ertskin doctor recording=mi", "recording=mine.h5"),
]


@pytest.fixture
def shell(tmp_path):
    """Runs a script in a shell that finds the program; skipped where there is no such shell."""
    program = tmp_path / "ertskin"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m ertskin.cli "$@"\n')
    program.chmod(0o755)
    (tmp_path / "mine.h5").touch()
    environment = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}", "HOME": str(tmp_path)}

    def run(name, *words):
        if shutil.which(name) is None:
            pytest.skip(f"{name} is not installed")
        return subprocess.run(
            [name, *words], capture_output=True, text=True, check=True, env=environment, cwd=tmp_path, timeout=60
        ).stdout

    return run


def test_bash_completes_what_follows_an_equals_sign(shell):
    typed = "ertskin train model=reci"
    asked = f'{script("bash")}COMP_LINE="{typed}" COMP_POINT={len(typed)}; _ertskin; printf "%s|" "${{COMPREPLY[@]}}"'
    assert shell("bash", "-c", asked) == "reciprocal |"


@pytest.mark.parametrize(("typed", "whole"), COMPLETED)
def test_fish_completes(shell, typed, whole):
    assert shell("fish", "-c", f"{script('fish')}complete -C '{typed}'").split() == [whole]


@pytest.mark.parametrize(("typed", "whole"), COMPLETED)
def test_zsh_completes(shell, typed, whole):
    pressed = f"""
        zmodload zsh/zpty
        zpty z zsh -f -i
        zpty -w z 'eval "$(ertskin --completion zsh)"; echo READ""Y'
        zpty -r -m z told '*READY*'
        zpty -w -n z "{typed}"$'\\t'
        zpty -r -m z told '*{whole}*'
        print completed
    """
    assert shell("zsh", "-c", pressed).strip() == "completed"


def test_help_is_there_at_once():
    assert command_s("--help") < 0.5 * light_imports_s()


def test_doctor_answers_at_once(shared_data):
    # Three to four times as long as its imports, a second where those take a third of one.
    recording = shared_data / "recordings" / "rig_a_train.h5"
    assert command_s("doctor", f"recording={recording}") < 5 * light_imports_s()


def test_doctor_needs_none_of_the_heavy_packages(shared_data):
    recording = shared_data / "recordings" / "rig_a_train.h5"
    code = f"import sys; from ertskin import cli; cli.main(['doctor', 'recording={recording}']); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"torch", "lightning", "mlflow", "scipy", "matplotlib"} & set(done.stdout.splitlines()[-1].split())


def test_a_configuration_is_composed_once(monkeypatch, tmp_path, capsys):
    from hydra._internal.config_loader_impl import ConfigLoaderImpl

    composed = []
    compose = ConfigLoaderImpl.load_configuration
    monkeypatch.setattr(
        ConfigLoaderImpl, "load_configuration", lambda *args, **kwargs: composed.append(1) or compose(*args, **kwargs)
    )
    assert cli.main(["doctor", f"recording={tmp_path / 'absent.h5'}"]) == 2
    assert len(composed) == 1


@pytest.mark.parametrize("word", ["experiment=sweep", "+experiment=mine", "hydra.mode=MULTIRUN", "-m", "--config-dir"])
def test_a_file_may_ask_for_a_sweep(word):
    assert cli._may_ask_for_sweep(["seed=0", word])
    assert not cli._may_ask_for_sweep(["seed=0"])


def test_options_may_stand_between_overrides():
    arguments = ["a=1", "-m", "b=2", "--config-dir", "there", "c=3"]
    assert cli._options_first(arguments) == ["-m", "--config-dir", "there", "a=1", "b=2", "c=3"]


def test_a_sweep_is_named_by_what_it_asks_for():
    asked = cli.sweep_key("train", ["-m", "a=1,2", "b=3"])
    assert cli.sweep_key("train", ["b=3", "a=1,2", "--multirun", "hydra/launcher=joblib"]) == asked
    assert cli.sweep_key("train", ["-m", "a=1,2", "b=4"]) != asked


def test_the_configuration_offers_what_it_has():
    assert "paper" in choices("model")
    assert "mlflow" in choices("tracking")


def test_the_dashboard_serves_until_stopped_and_leaves_nothing_running(workplace):
    command = [sys.executable, "-m", "ertskin.cli", "dashboard", "port=0", "open=false"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        line = server.stdout.readline()
        assert "http://127.0.0.1:" in line
        assert "workflowType=machine_learning" in line
        server.send_signal(signal.SIGINT)
        _, err = server.communicate(timeout=30)
    finally:
        server.kill()
    assert server.returncode == 130
    assert err == "ertskin: stopped\n"
    port = int(line.split("127.0.0.1:")[1].split("/")[0])
    deadline = time.monotonic() + 10
    while _listens(port) and time.monotonic() < deadline:
        time.sleep(0.2)
    assert not _listens(port)


def _listens(port: int) -> bool:
    import socket

    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


SAYS_ALL_AT_ONCE = """
import sys
from ertskin import cli
from ertskin.commands import doctor
doctor.run = lambda config: print("all of it", flush=True)
sys.exit(cli.main(sys.argv[1:]))
"""


@pytest.mark.parametrize("word", ["--help", "doctor"])
def test_output_cut_short_by_a_pipe_is_no_error(word):
    command = [sys.executable, "-c", SAYS_ALL_AT_ONCE, word]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.close()
    assert process.stderr.read() == ""
    assert process.wait() == 1
