"""What may come next on the command line, for the shell's completion: verbs, groups, choices, settings."""

from __future__ import annotations

from ertskin.commands import verbs
from ertskin.configuration import choices, groups, settings
from ertskin.errors import UserError

BASH = """_ertskin() {
    local IFS=$'\\n' line="${COMP_LINE:0:COMP_POINT}"
    COMPREPLY=($(ertskin --complete "$line"))
    # Bash breaks words at "=" and replaces what follows it alone.
    local word="${line##* }"
    [[ "$word" == *=* ]] && COMPREPLY=("${COMPREPLY[@]#"${word%=*}="}")
    [[ ${#COMPREPLY[@]} -eq 1 && "${COMPREPLY[0]}" != *= ]] && COMPREPLY=("${COMPREPLY[0]} ")
    return 0
}
complete -o nospace -o default -F _ertskin ertskin
"""
ZSH = """(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }
_ertskin() {
    local -a found
    found=(${(f)"$(ertskin --complete "$LBUFFER")"})
    compadd -Q -S '' -- ${(M)found:#*=}
    compadd -Q -- ${found:#*=}
    # Nothing of ours: a file, by itself or behind "=".
    (( $#found )) || { compset -P '*='; _files }
}
compdef _ertskin ertskin
"""
FISH = """complete -c ertskin -f -a '(ertskin --complete (commandline -cp))'
complete -c ertskin -n 'test -z "$(ertskin --complete (commandline -cp))"' -F
"""
SCRIPTS = {"bash": BASH, "zsh": ZSH, "fish": FISH}


def script(shell: str) -> str:
    """What a shell evaluates to complete our commands; ``UserError`` for one we have none for."""
    if shell not in SCRIPTS:
        raise UserError(f"no completion for '{shell}': choose one of {', '.join(SCRIPTS)}")
    return SCRIPTS[shell]


def completions(line: str) -> list[str]:
    """Words that may stand in the place of the last one of ``line``, which begins with the program's name."""
    words = line.split(" ")
    current, known = words[-1], verbs()
    if len(words) <= 2:
        return [verb for verb in known if verb.startswith(current)]
    verb = words[1]
    if verb not in known:
        return []
    key, equals, value = current.partition("=")
    if equals:
        before, comma, begun = value.rpartition(",")
        return [f"{key}={before}{comma}{name}" for name in choices(key) if name.startswith(begun)]
    chosen = groups(verb)
    typed = [word.partition("=") for word in words[2:-1]]
    chosen |= {group: choice for group, _, choice in typed if group in chosen}
    section, dot, _ = current.partition(".")
    names = [*chosen, *settings(verb)]
    if dot:
        names = [f"{section}.{name}" for name in settings(section, chosen.get(section))]
    return [f"{name}=" for name in names if name.startswith(current)]
