# Completions of drivebench for bash. Add to ~/.bashrc:  source <(drivebench completions bash)
_drivebench() {
    local line="${COMP_LINE:0:COMP_POINT}" kind current
    local -a words
    read -ra words <<<"$line"
    [[ $line == *[[:space:]] ]] && words+=("")
    current="${words[-1]}"
    mapfile -t COMPREPLY < <("${words[0]}" complete -- "${words[@]:1}" 2>/dev/null)
    kind="${COMPREPLY[0]}"
    COMPREPLY=("${COMPREPLY[@]:1}")
    [[ $kind == files ]] && mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -f -- "$current")
    # bash splits words at colons and equal signs and replaces only the last part.
    COMPREPLY=("${COMPREPLY[@]#"${current%"${current##*[:=]}"}"}")
    [[ ${COMPREPLY[0]} == *= ]] && compopt -o nospace 2>/dev/null
    return 0
}
complete -o filenames -F _drivebench drivebench
