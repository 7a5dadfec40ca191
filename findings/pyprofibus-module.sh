#!/usr/bin/env bash
# pyprofibus 1.13: a module that the GSD does not have is replaced by the one with the most similar name.
#
# Source: pyprofibus/gsd/interp.py, `findModule`, falls back to `difflib.get_close_matches`. A GSD names modules exactly (PROFIBUS Guideline
# "Specification for PROFIBUS Device Description and Device Integration"), and Chk_Cfg must have the bytes of the module that is meant.
# Behaviour: no error and no warning. The master sends the configuration of another module: a slave with the right one refuses it in its diagnosis, and
# a slave that has both takes data of another length or meaning.
# Seen: the lines below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
python3 -m venv v && v/bin/pip install --quiet --disable-pip-version-check pyprofibus==1.13 || exit 2

expected=$(cat <<'END'
PPO 2: 4 PKW 6 PZD -> PPO 2: 4 PKW 6 PZD
PPO 5: 4 PKW 10 PZD -> PPO 2: 4 PKW 6 PZD
PPO 4: 0 PKW 6 PZD -> PPO 3: 0 PKW 2 PZD
END
)
cat >slave.gsd <<'END'
#Profibus_DP
GSD_Revision = 1
Vendor_Name = "Nobody"
Model_Name = "Four modules"
Revision = "1"
Ident_Number = 0x1234
Protocol_Ident = 0
Station_Type = 0
19.2_supp = 1
MaxTsdr_19.2 = 60
Modular_Station = 1
Max_Module = 1
Max_Input_Len = 20
Max_Output_Len = 20
Max_Data_Len = 40
Module = "PPO 1: 4 PKW 2 PZD" 0xF3, 0xF1
EndModule
Module = "PPO 2: 4 PKW 6 PZD" 0xF3, 0xF5
EndModule
Module = "PPO 3: 0 PKW 2 PZD" 0xF1
EndModule
END
seen=$(v/bin/python - 2>&1 <<'END'
from pyprofibus.gsd.interp import GsdInterp

gsd = GsdInterp.fromFile("slave.gsd")
for name in ("PPO 2: 4 PKW 6 PZD", "PPO 5: 4 PKW 10 PZD", "PPO 4: 0 PKW 6 PZD"):
    print(f"{name} -> {gsd.findModule(name).name}")
END
)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
