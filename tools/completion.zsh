# Completion of `dart-skill` with TAB in zsh: tools/env.sh sources it. In another shell: source tools/completion.zsh
# dart-skill itself says what may follow, through argcomplete; without that, file names are completed, as for any command.

_dart_skill_complete() {
  local line="${(j: :)words[1,CURRENT]}" told
  local -a offered joined
  if told=$(COMP_LINE=$line COMP_POINT=${#line} _ARGCOMPLETE=1 _ARGCOMPLETE_SHELL=zsh _ARGCOMPLETE_IFS=$'\013' \
      _ARGCOMPLETE_SUPPRESS_SPACE=1 "$words[1]" 8>&1 >/dev/null 2>&1 </dev/null); then
    offered=("${(@ps:\v:)told}")
    [[ -n $told ]] || return 1
    joined=(-S '')
    [[ ${offered[1]} == *[=/]:* ]] || joined=()
    _describe dart-skill offered "${joined[@]}"
  else
    _files
  fi
}

# A shell without any completion gets zsh's own; one that has it keeps its settings.
if [[ -o interactive ]] && ! (( $+functions[compdef] )); then
  autoload -Uz compinit && compinit -i -D
fi
if (( $+functions[compdef] )); then
  compdef _dart_skill_complete dart-skill
fi
