# Completion of `dart-skill` with TAB in bash: tools/env.sh sources it. In another shell: source tools/completion.bash
# dart-skill itself says what may follow, through argcomplete; without that, file names are completed, as for any command.

_dart_skill_complete() {
  local told
  if told=$(COMP_LINE=$COMP_LINE COMP_POINT=$COMP_POINT _ARGCOMPLETE_COMP_WORDBREAKS=$COMP_WORDBREAKS _ARGCOMPLETE=1 \
      _ARGCOMPLETE_SHELL=bash _ARGCOMPLETE_IFS=$'\013' _ARGCOMPLETE_SUPPRESS_SPACE=1 "$1" 8>&1 >/dev/null 2>&1 </dev/null); then
    IFS=$'\013\n' read -r -d '' -a COMPREPLY <<<"$told"
    case ${COMPREPLY[0]-} in *[=/:]) compopt -o nospace 2>/dev/null ;; esac
  else
    compopt -o default 2>/dev/null
  fi
  return 0
}

complete -F _dart_skill_complete dart-skill 2>/dev/null || true
