# Completions of drivebench for fish. Save as ~/.config/fish/completions/drivebench.fish.
function __drivebench
    set -l words (commandline -opc) (commandline -ct)
    set -l lines ($words[1] complete -- $words[2..-1] 2>/dev/null)
    printf '%s\n' $lines[2..-1]
    if test "$lines[1]" = files
        __fish_complete_path (commandline -ct)
    end
end
complete -c drivebench -f -a '(__drivebench)'
