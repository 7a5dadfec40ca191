#compdef drivebench
# Completions of drivebench for zsh. Save as _drivebench in a folder of $fpath.
_drivebench() {
    local -a lines
    lines=("${(@f)$("${words[1]}" complete -- "${(@)words[2,CURRENT]}" 2>/dev/null)}")
    compadd -- "${(@)lines[2,-1]}"
    [[ ${lines[1]} == files ]] && _files
    return 0
}
if [ "$funcstack[1]" = "_drivebench" ]; then
    _drivebench "$@"
else
    compdef _drivebench drivebench
fi
